#!/bin/bash
# CMake/demo.sh: from nothing to seen on Debian 12: packages, build, and five organs that breathe. Ends with each frame's
# figures and the places of the picture and the report. Further arguments go to OrganScene (see --help).
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
mkdir -p build

# build TARGET [-DOPTION...]: what the scene needs of the library and, of SIMD code, the path that this machine takes.
build() {
  cmake --preset release -B build/demo -DPALPATE_SIMD_NATIVE=ON -DPALPATE_BUILD_TESTING=OFF -DPALPATE_WITH_FCL=OFF \
    -DPALPATE_WITH_SIMPLIFY=OFF -DPALPATE_WITH_PYTHON=OFF -DPALPATE_WITH_C=OFF "${@:2}" >build/demo.log || {
    cat build/demo.log
    exit 1
  }
  cmake --build build/demo --parallel "$(nproc)" --target "$1"
}

if CMake/packages.sh --missing demo; then
  echo "1 of 4: packages of the compiler (some seconds)"
  CMake/packages.sh core
  echo "2 of 4: the library (about 2 minutes on two idle cores), while the packages of the scene are installed"
  CMake/packages.sh demo &
  build Palpate -DPALPATE_WITH_VTK=OFF -DPALPATE_BUILD_EXAMPLES=OFF
  wait || true
  CMake/packages.sh demo  # says what was wrong, if anything was
fi
echo "3 of 4: the scene, and the library where it is not built (1 to 3 minutes)"
build OrganScene -DPALPATE_WITH_VTK=ON -DPALPATE_BUILD_EXAMPLES=ON
echo "4 of 4: the run"
xvfb-run -a build/demo/Examples/OrganScene/OrganScene "$@"
