#!/bin/bash
# From nothing to seen: packages, build, and five organs that breathe. Ends with each stage's times
# and the place of the picture. Further arguments go to OrganScene (see --help).
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

CMake/packages.sh build
cmake --preset release -DPALPATE_BUILD_TESTING=OFF -B build/demo >/dev/null
cmake --build build/demo --parallel "$(nproc)" --target OrganScene
xvfb-run -a build/demo/Examples/OrganScene/OrganScene "$@"
