#!/usr/bin/env bash
# Builds and runs everything in C and C++ against an installed fogbow: tests/run.sh PREFIX
#
# Needs gcc, clang, pkg-config, cmake and valgrind.
set -euo pipefail
prefix=$(realpath "${1:?tests/run.sh PREFIX}")
cd "$(dirname "${BASH_SOURCE[0]}")/.."
out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT

export PKG_CONFIG_PATH=$prefix/lib/pkgconfig LD_LIBRARY_PATH=$prefix/lib
read -ra flags <<<"-pedantic -O2 -Wall -Wextra -Werror $(pkg-config --cflags fogbow)"
read -ra shared <<<"$(pkg-config --libs fogbow)"
read -ra static <<<"-Wl,-Bstatic -lfogbow -Wl,-Bdynamic -L$prefix/lib $(pkg-config --static --libs-only-l fogbow | sed 's/-lfogbow//')"

build_and_run() {
    local cc=$1 cxx=$2 standard header source name
    mkdir -p "$out/$cc"
    # The headers by themselves, in both languages.
    for standard in c99 c17; do
        echo '#include <fogbow.h>' | "$cc" -std=$standard "${flags[@]}" -fsyntax-only -x c -
    done
    for header in fogbow.h fogbow.hpp; do
        echo "#include <$header>" | "$cxx" -std=c++17 "${flags[@]}" -fsyntax-only -x c++ -
    done
    for source in examples/{atrium,bake,fog,formulas,smoke_box}.c tests/misuse.c; do
        "$cc" -std=c99 "${flags[@]}" -o "$out/$cc/$(basename "$source" .c)" "$source" "${shared[@]}" -lm
    done
    "$cxx" -std=c++17 "${flags[@]}" -o "$out/$cc/jobs" examples/jobs.cpp "${shared[@]}" -pthread
    echo "$cc and $cxx: built without a warning"
    # Programs leave pictures where they run.
    (cd "$out/$cc"; for name in formulas smoke_box atrium; do "./$name" >"$name.txt"; done)
    for name in smoke_box atrium; do
        diff "examples/$name.txt" "$out/$cc/$name.txt"
    done
}

# Beside each other: most of the time is that of programs on one core.
build_and_run gcc g++ & gcc=$!
build_and_run clang clang++ & clang=$!
wait "$gcc"
wait "$clang"
cat "$out"/gcc/{formulas,smoke_box,atrium}.txt
(cd "$out" && gcc/bake && gcc/jobs && gcc/misuse)
lines=$(wc -l <examples/fog.c)
((lines < 60))
echo "fog.c, a world and a ray caster: $lines lines"

gcc -std=c99 "${flags[@]}" -o "$out/static" examples/smoke_box.c -L"$prefix/lib" "${static[@]}" -lm
env -u LD_LIBRARY_PATH "$out/static" | diff examples/smoke_box.txt -
echo "the static library: the same bits"

cat >"$out/CMakeLists.txt" <<'CMAKE'
cmake_minimum_required(VERSION 3.16)
project(host C)
find_package(fogbow 0.1 REQUIRED)
foreach(kind fogbow static)
    add_executable(with_${kind} ${SOURCE})
    target_link_libraries(with_${kind} PRIVATE fogbow::${kind} m)
endforeach()
CMAKE
cmake -S "$out" -B "$out/cmake" -DCMAKE_PREFIX_PATH="$prefix" -DSOURCE="$PWD/examples/formulas.c" >"$out/log" &&
    cmake --build "$out/cmake" >>"$out/log" || {
    cat "$out/log"
    exit 1
}
env -u LD_LIBRARY_PATH "$out/cmake/with_fogbow" | diff "$out/gcc/formulas.txt" -
env -u LD_LIBRARY_PATH "$out/cmake/with_static" | diff "$out/gcc/formulas.txt" -
echo "CMake: shared and static"

for program in misuse formulas; do
    (cd "$out" && valgrind -q --leak-check=full --errors-for-leak-kinds=definite,indirect,possible --error-exitcode=9 \
        "gcc/$program" >/dev/null)
    echo "valgrind: no error and no leak in $program"
done
