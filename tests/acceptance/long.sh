#!/usr/bin/env bash
# Tests that are part of the workspace and ignored by its test command, as they take minutes in all: statistics over several seeds.
#
#   tests/acceptance/long.sh [PART-OF-A-NAME]
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
# What else is ignored prints times.
cargo test --locked --workspace --lib --test all -- --ignored --skip speed "$@"
