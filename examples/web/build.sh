#!/usr/bin/env bash
# Builds the package and the page: bash build.sh OUT
# OUT/package is what npm packs, OUT/page what a static host serves.
#
# Needs a compiler with the source of its library (Debian: rustc-web and rust-web-src), rustup's for its linker, node, and binaryen's wasm-opt.
set -euo pipefail
own=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
out=$(realpath -m "${1:?bash build.sh OUT}")
cd "$own"
TARGET=${CARGO_TARGET_DIR:-$own/../../target}/web

linker=$(rustc --print sysroot)/lib/rustlib/$(rustc --print host-tuple)/bin/rust-lld
# Functions are inlined where they are very short, those that ask for it where they are short: smaller by a quarter, and what must be inlined says so.
# Loops are unrolled where that leaves no loop and little code, and not otherwise; none of them is worth the vectors that a compiler sees in it. Panics have no words,
# nobody prints with `{:?}`, and the library's own sorting is the small one, whose results are the same. What the core has made of a generic function is not made again.
flags="-Cllvm-args=-unroll-threshold=40 -Cllvm-args=-unroll-runtime=0 -Cllvm-args=-unroll-allow-partial=0 -Cno-vectorize-loops
    -Zshare-generics=y -Zunstable-options -Cpanic=immediate-abort -Zfmt-debug=none -Zlocation-detail=none"
# module NAME FLAGS
module() {
    env RUSTC=/usr/bin/rustc RUSTDOC=/usr/bin/rustdoc RUSTC_BOOTSTRAP=1 CARGO_TARGET_WASM32_UNKNOWN_UNKNOWN_LINKER="$linker" RUSTFLAGS="$flags $2" \
        cargo rustc --quiet --locked --lib --crate-type cdylib --profile module \
        -Zbuild-std=core,alloc,panic_abort -Zbuild-std-features=optimize_for_size --target wasm32-unknown-unknown --target-dir "$TARGET/$1"
    # In the first kilobyte of memory is the end of the stack, and nothing that has an address: so small offsets never wrap, and go into instructions.
    wasm-opt --low-memory-unused --merge-similar-functions -Os -Oz --enable-simd --enable-bulk-memory --enable-sign-ext --enable-mutable-globals --enable-nontrapping-float-to-int \
        "$TARGET/$1/wasm32-unknown-unknown/module/fogbow_web.wasm" -o "$out/$1.wasm"
}

rm -rf "$out"
mkdir -p "$out"
# Most of either is one thread that optimises everything together.
module plain "-Cllvm-args=-inline-threshold=5 -Cllvm-args=-inlinehint-threshold=40" &
plain=$!
# Instructions for vectors make shorter code: there is room to inline more.
module simd "-Cllvm-args=-inline-threshold=10 -Cllvm-args=-inlinehint-threshold=55 -Ctarget-feature=+simd128"
wait $plain
node scripts/pack.mjs "$out/package" "$out/plain.wasm" "$out/simd.wasm"
node scripts/site.mjs "$out/page" "$out/package"
