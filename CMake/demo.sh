#!/bin/bash
# CMake/demo.sh: from nothing to seen on Debian 12: packages, build, and five organs that breathe. Ends with each frame's
# figures and the places of the picture and the report. Further arguments go to OrganScene (see --help).
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

echo "1 of 3: packages (at most a minute)"
CMake/packages.sh demo
echo "2 of 3: compilation (about 4 minutes on two idle cores)"
# Of SIMD code only the path that this machine takes.
mkdir -p build
cmake --preset release -DPALPATE_SIMD_NATIVE=ON -DPALPATE_BUILD_TESTING=OFF -DPALPATE_WITH_FCL=OFF \
  -DPALPATE_WITH_SIMPLIFY=OFF -DPALPATE_WITH_PYTHON=OFF -B build/demo >build/demo.log || { cat build/demo.log; exit 1; }
cmake --build build/demo --parallel "$(nproc)" --target OrganScene
echo "3 of 3: the scene"
xvfb-run -a build/demo/Examples/OrganScene/OrganScene "$@"
