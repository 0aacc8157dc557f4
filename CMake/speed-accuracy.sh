#!/bin/bash
# CMake/speed-accuracy.sh: installs packages, builds, measures each method on each scene, and draws the chart. This takes
# minutes. A run that was stopped continues where it was. Arguments go to SpeedAccuracy (see --help).
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

CMake/packages.sh build figures
CMake/packages.sh benchmark || echo "without FCL"
cmake --preset release -DPALPATE_BUILD_TESTING=OFF -B build/demo >/dev/null
cmake --build build/demo --parallel "$(nproc)" --target SpeedAccuracy
out=out/speed-accuracy
build/demo/Examples/SpeedAccuracy/SpeedAccuracy --budget-frames 120 "$@" --out "$out"
/usr/bin/python3 Docs/Figures/speedAccuracy.py "$out/speed-accuracy.csv" "$out/speed-accuracy"
[[ ! -f $out/rigid-bodies.csv ]] || /usr/bin/python3 Docs/Figures/rigidBodies.py "$out/rigid-bodies.csv" "$out/rigid-bodies"
/usr/bin/python3 Docs/Figures/budgets.py "$out/budgets.csv" "$out/budgets"
echo "charts    $out/speed-accuracy.svg, $out/rigid-bodies.svg"
