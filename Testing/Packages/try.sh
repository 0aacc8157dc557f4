#!/bin/bash
# try.sh PACKAGE.deb...: installs the packages into a bare Debian 12, and uses each: a C++ and a C program by pkg-config, a
# C++ program by CMake, Python, commands and their manual pages. Needs root, mmdebstrap and the mirror of apt.
set -euo pipefail
root=$(mktemp -d)
trap 'rm -rf "$root"' EXIT
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
packages=()
for package in "$@"; do packages+=("$(realpath "$package")"); done
mmdebstrap --variant=minbase bookworm "$root" >"$root.log" 2>&1 || { cat "$root.log"; exit 1; }
mkdir -p "$root/packages" "$root/program"
cp "${packages[@]}" "$root/packages"
cp "$here"/../Consumer/Project/Contacts.cpp "$here"/../../Examples/HelloCollisionC/HelloCollision.c "$root/program"
inside() { chroot "$root" env DEBIAN_FRONTEND=noninteractive "$@"; }
inside apt-get -qq update
inside bash -c 'apt-get -qq install -y --no-install-recommends /packages/libpalpate0_*.deb >/dev/null'
echo "libpalpate0 alone needs:"
inside bash -c 'ldd /usr/lib/*/libPalpate.so.0' | tee "$root/ldd"
grep -q "not found" "$root/ldd" && { echo "try.sh: a library is missing" >&2; exit 1; }
# VTK's development files need Java, which does not install without /proc.
rm "$root"/packages/libpalpate-vtk-dev_*.deb
inside bash -c 'apt-get -qq install -y --no-install-recommends /packages/*.deb g++ cmake make pkg-config >/dev/null'
echo "--- a program by pkg-config"
inside bash -c 'cd /program && g++ -std=c++20 Contacts.cpp $(pkg-config --cflags --libs palpate) -o contacts && ./contacts'
echo "--- a C program by pkg-config"
inside bash -c 'cd /program && gcc -std=c99 HelloCollision.c $(pkg-config --cflags --libs palpate) -lm -o c && ./c'
echo "--- a program by CMake"
cat >"$root/program/CMakeLists.txt" <<'EOF'
cmake_minimum_required(VERSION 3.25)
project(Try LANGUAGES CXX)
find_package(Palpate 0.1 REQUIRED COMPONENTS MeshFiles)
add_executable(try Contacts.cpp)
target_link_libraries(try PRIVATE Palpate::MeshFiles)
EOF
inside bash -c 'cd /program && cmake -S . -B build >/dev/null && cmake --build build >/dev/null && build/try'
echo "--- Python"
inside python3 -c '
import palpate
collisions = palpate.OctreeBasedCD()
print("palpate", palpate.__version__, palpate.__file__)
'
echo "--- commands"
inside bash -c 'cd /tmp && palpate-x-ray --frames 1 --pixels 64 --out out && test -s out/scene.pgm'
inside palpate-check --help >"$root/check"
head -n 3 "$root/check"
for page in "$root"/usr/share/man/man1/palpate-*.1.gz; do
  zgrep -q -e '-help' "$page" || { echo "try.sh: $page has no options" >&2; exit 1; }
done
echo "--- removal"
inside bash -c 'dpkg --purge palpate-tools python3-palpate libpalpate-dev libpalpate-vtk0 libpalpate0 >/dev/null && ! ls /usr/lib/*/libPalpate* 2>/dev/null'
echo "try.sh: installed, used and removed in a bare Debian 12"
