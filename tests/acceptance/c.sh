#!/usr/bin/env bash
# What of the interface for C takes longer than CI has: the examples under valgrind, the same bits on AArch64, under emulation, and the
# job example under ThreadSanitizer. The last two build Rust's own library, ten minutes of CPU time in all:
#
#   tests/acceptance/c.sh [memory] [aarch64] [threads]
#
# Needs gcc; for memory valgrind; for the others Debian's rustc-web and rust-web-src; for aarch64 also gcc-aarch64-linux-gnu,
# libc6-dev-arm64-cross and qemu-user; for threads g++.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
target=${CARGO_TARGET_DIR:-$PWD/target}/acceptance
out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT

# The static library for a target, with the compiler that has its library's source.
build() {
    env RUSTC=/usr/bin/rustc RUSTDOC=/usr/bin/rustdoc RUSTC_BOOTSTRAP=1 RUSTFLAGS="$2" \
        cargo rustc --locked --release -Zbuild-std=std,panic_unwind --target "$1" --lib -p fogbow-c --target-dir "$3" \
        --crate-type staticlib
}

# The profile is that of the tests, or PROFILE.
step_memory() {
    local name
    examples/c/install.sh --prefix "$out/c" --profile "${PROFILE:-test}"
    for name in bake fog formulas; do
        gcc -std=c99 -g -O2 -Wall -Wextra -Werror -I"$out/c/include" -o "$out/$name" "examples/c/examples/$name.c" \
            -L"$out/c/lib" -Wl,-rpath,"$out/c/lib" -lfogbow -lm
        (cd "$out" && valgrind -q --leak-check=full --errors-for-leak-kinds=definite,indirect,possible --error-exitcode=9 \
            "./$name" >/dev/null)
        echo "valgrind: no error and no leak in $name"
    done
}

step_aarch64() {
    local triple=aarch64-unknown-linux-gnu
    build $triple "" "$target/aarch64"
    local room
    for room in smoke_box atrium; do
        aarch64-linux-gnu-gcc -std=c99 -O2 -Wall -Wextra -Werror -Iexamples/c/include -o "$out/$room" \
            examples/c/examples/$room.c "$target/aarch64/$triple/release/libfogbow_c.a" -static -lm -lpthread -ldl 2>"$out/log" || {
            cat "$out/log"
            return 1
        }
        qemu-aarch64 "$out/$room" | tee "$out/digests"
        diff examples/c/examples/$room.txt "$out/digests"
    done
    echo "AArch64: the same bits"
}

step_threads() {
    local triple=x86_64-unknown-linux-gnu
    build $triple "-Zsanitizer=thread -Zexternal-clangrt" "$target/threads"
    # Names that LLVM's runtime has and GCC's has not: the functions behind them are watched by both.
    gcc -O1 -fno-builtin -c -o "$out/names.o" -x c - <<'C'
#include <string.h>
void *__tsan_memcpy(void *to, const void *from, size_t count) { return memcpy(to, from, count); }
void *__tsan_memmove(void *to, const void *from, size_t count) { return memmove(to, from, count); }
void *__tsan_memset(void *to, int value, size_t count) { return memset(to, value, count); }
C
    g++ -std=c++17 -g -O2 -fsanitize=thread -Iexamples/c/include -o "$out/jobs" examples/c/examples/jobs.cpp \
        "$target/threads/$triple/release/libfogbow_c.a" "$out/names.o" -lpthread -lm -ldl
    TSAN_OPTIONS=halt_on_error=1 "$out/jobs"
    echo "ThreadSanitizer: no race"
}

asked=("$@")
((${#asked[@]})) || asked=(memory aarch64 threads)
for step in "${asked[@]}"; do
    "step_$step"
done
