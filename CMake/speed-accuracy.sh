#!/bin/bash
# From nothing to the chart of speed against accuracy: packages, build, every method on every scene (minutes; stopped, it
# goes on where it was). Arguments go to SpeedAccuracy (see --help).
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

CMake/packages.sh build
CMake/packages.sh benchmark || echo "without FCL"
cmake --preset release -DPALPATE_BUILD_TESTING=OFF -B build/demo >/dev/null
cmake --build build/demo --parallel "$(nproc)" --target SpeedAccuracy
xvfb-run -a build/demo/Examples/SpeedAccuracy/SpeedAccuracy --out out/speed-accuracy "$@"
