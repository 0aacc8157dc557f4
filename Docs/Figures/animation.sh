#!/bin/bash
# Docs/Figures/animation.sh: draws Docs/Pictures/Organs.webp, a period of LiverLift as a loop of 4 s. It
# builds the scene in build/demo. The pictures need no display.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."

CMake/packages.sh build figures
cmake --preset release -DPALPATE_BUILD_TESTING=OFF -B build/demo >/dev/null
cmake --build build/demo --parallel "$(nproc)" --target LiverLift
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
xvfb-run -a build/demo/Examples/LiverLift/LiverLift --frames 150 --size 800 500 --pictures 30 3 --out "$folder"
/usr/bin/python3 Docs/Figures/animation.py "$folder/pictures" Docs/Pictures/Organs.webp
