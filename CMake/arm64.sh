#!/bin/bash
# CMake/arm64.sh FOLDER: unpacks Debian's packages for 64-bit ARM that the library and its tests need into FOLDER. The
# system's own packages and package lists stay as they are. Returns at once when all are there.
set -euo pipefail

packages="libhwy-dev libhwy1 libgmp-dev libgmp10 libgmpxx4ldbl libmeshoptimizer-dev libmeshoptimizer2d libeigen3-dev
  libgtest-dev libcli11-dev nlohmann-json3-dev"
mkdir -p "$1"
root=$(cd "$1" && pwd)
[[ -e $root/complete && $(<"$root/complete") == "$packages" ]] && exit 0

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
mkdir -p "$work/lists/partial"
cd "$work"
arm64() {
  apt-get -qq -o APT::Architecture=arm64 -o APT::Architectures=arm64 -o APT::Sandbox::User= -o Dir::State::status=/dev/null \
    -o Dir::State::lists="$work/lists" -o Dir::Cache::pkgcache= -o Dir::Cache::srcpkgcache= "$@"
}
arm64 update
# shellcheck disable=SC2086
arm64 download $packages
for package in *.deb; do dpkg -x "$package" "$root"; done
mv "$root"/usr/include/aarch64-linux-gnu/* "$root/usr/include/" # a cross compiler does not look there
echo "$packages" >"$root/complete"
