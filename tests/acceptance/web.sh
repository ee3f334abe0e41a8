#!/usr/bin/env bash
# The package and the page in full: bash tests/acceptance/web.sh [FOLDER-FOR-PICTURES]
#
# Same bits natively and in WebAssembly at the effort of pictures, with figures of speed; the README's page and its example for Vite in a browser; memory after
# 10 000 worlds, caches and probes; the page on a phone's width and in the dark, 50 bakes, and the difference from the truth; the shader against the core, and on textures with finer levels.
#
# Needs what the step `web` of .ci/run installs. Ten minutes.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
TARGET=${CARGO_TARGET_DIR:-$PWD/target}
out=$TARGET/web-out
pictures=${1:-$(mktemp -d)}
mkdir -p "$pictures"
npm ci --prefix examples/web/tests --no-audit --no-fund --silent
bash examples/web/build.sh "$out"
cargo build --quiet --locked --release --example digests --manifest-path examples/web/Cargo.toml --target-dir "$TARGET/web/native"
failed=0
node examples/web/tests/digests.mjs "$TARGET/web/native/release/examples/digests" "$out/package" --full || failed=1
node examples/web/tests/package.mjs "$out/package" --full || failed=1
node examples/web/tests/shader.mjs "$out/page" || failed=1
cargo build --quiet --locked --release --bin fogbow --target-dir "$TARGET"
"$TARGET/release/fogbow" bake examples/scenes/smoke-box-homogeneous-anisotropic.xml --counts 8x8x8 --error 0.1 --refine 0.05 -q -o "$pictures/levels.ktx2"
node examples/web/tests/levels.mjs "$pictures" levels || failed=1
node examples/web/tests/page.mjs "$out/page" --full --pictures "$pictures" || failed=1
echo "pictures to be looked at: $pictures"
exit $failed
