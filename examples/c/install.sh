#!/usr/bin/env bash
# Builds fogbow for C and C++ and installs it: libraries, headers, fogbow.pc, and what CMake's find_package(fogbow) reads. For Linux.
#
#   ./install.sh --prefix /usr/local        (the default)
#   ./install.sh --prefix DIR --profile NAME --destdir DIR --target TRIPLE
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")"

prefix=/usr/local profile=release destdir= target=
while (($#)); do
    case $1 in
        --prefix) prefix=${2:?} ;;
        --profile) profile=${2:?} ;;
        --destdir) destdir=${2:?} ;;
        --target) target=${2:?} ;;
        *)
            sed -n '2,5s/^# \{0,1\}//p' "$0" >&2
            exit 2
            ;;
    esac
    shift 2
done
[[ $prefix == /* ]] || prefix=$PWD/$prefix

version=$(sed -n '/^\[workspace.package\]/,/^$/s/^version = "\(.*\)"/\1/p' ../../Cargo.toml)
cargo build --locked --lib -p fogbow-c --profile "$profile" ${target:+--target "$target"} ${CARGO_FLAGS:-}
folder=$profile
[[ $profile == dev || $profile == test ]] && folder=debug
built=${CARGO_TARGET_DIR:-../../target}/${target:+$target/}$folder

to=$destdir$prefix
mkdir -p "$to/include" "$to/lib/pkgconfig" "$to/lib/cmake/fogbow"
install -m 644 include/fogbow.h include/fogbow.hpp "$to/include"
install -m 644 "$built/libfogbow_c.a" "$to/lib/libfogbow.a"
install -m 755 "$built/libfogbow_c.so" "$to/lib/libfogbow.so.$version"
# Until 1.0, minor versions break.
ln -sf "libfogbow.so.$version" "$to/lib/libfogbow.so.${version%.*}"
ln -sf "libfogbow.so.${version%.*}" "$to/lib/libfogbow.so"
for name in fogbow.pc fogbow-config.cmake fogbow-config-version.cmake; do
    case $name in
        *.pc) place=$to/lib/pkgconfig/$name ;;
        *) place=$to/lib/cmake/fogbow/$name ;;
    esac
    sed -e "s|@PREFIX@|$prefix|g" -e "s|@VERSION@|$version|g" "packaging/$name.in" >"$place"
done
echo "installed fogbow $version into $to"
