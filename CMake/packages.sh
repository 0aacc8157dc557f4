#!/bin/bash
# CMake/packages.sh SET...: installs the Debian packages of the named sets (build, python, test, docs, figures, benchmark, coverage, package, windows),
# as root or through sudo. Returns at once when all are there.
set -euo pipefail

build="cmake ninja-build g++ pkg-config libeigen3-dev libtbb-dev libhwy-dev libgmp-dev libmeshoptimizer-dev
  libvtk9-dev libfcl-dev libccd-dev libcli11-dev nlohmann-json3-dev xvfb xauth libgl1-mesa-dri"
# All that pip needs to build the Python package, and SciPy for rows().
python="cmake ninja-build g++ pkg-config libeigen3-dev libhwy-dev libgmp-dev libmeshoptimizer-dev python3-dev
  pybind11-dev python3-numpy python3-scipy python3-pip python3-venv python3-setuptools python3-wheel"
test="python3 python3-pytest python3-mypy mypy python3-distributed libgtest-dev libcgal-dev libmpfr-dev clang-format-14 qemu-user
  clang-14 libclang-rt-14-dev g++-aarch64-linux-gnu chromium python3-vtk9 python3-matplotlib
  mono-mcs mono-runtime"
docs="doxygen python3-sphinx furo python3-myst-parser python3-breathe python3-sphinx-copybutton nodejs chromium"
windows="g++-mingw-w64-x86-64-posix wine64 dpkg-dev libgtest-dev"
package="lintian dpkg-dev fakeroot help2man"
figures="python3 python3-matplotlib python3-pil pngquant"
benchmark="python3 libbenchmark-dev libembree-dev libbullet-dev libcgal-dev libnanoflann-dev
  libopenvdb-dev"
coverage="python3 gcovr"

missing=()
for set in "$@"; do
  for package in ${!set}; do
    state=$(dpkg-query -W -f='${db:Status-Status}' "$package" 2>/dev/null || true)
    [[ $state == installed ]] || missing+=("$package")
  done
done
[[ ${#missing[@]} -eq 0 ]] && exit 0

echo "packages: installing ${missing[*]}"
if [[ $(id -u) -eq 0 ]]; then
  asRoot=()
elif command -v sudo >/dev/null; then
  asRoot=(sudo)
else
  echo "packages: neither root nor sudo; as root, run: apt-get install ${missing[*]}" >&2
  exit 1
fi
aptGet() {
  "${asRoot[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -qq -o Dpkg::Use-Pty=0 "$@" </dev/null
}
aptGet update
aptGet install -y --no-install-recommends "${missing[@]}" >/dev/null
