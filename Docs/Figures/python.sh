#!/bin/bash
# Docs/Figures/python.sh: draws the pictures of the Python examples. It needs the package palpate on PYTHONPATH.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."

CMake/packages.sh python test figures
python=/usr/bin/python3  # the interpreter of Debian's packages
xvfb-run -a "$python" -B Examples/Python/cloth.py Docs/Pictures/Cloth.png
"$python" -B Examples/Python/needle.py Docs/Pictures/NeedlePaths.png
pngquant --speed 1 --strip --force --ext .png Docs/Pictures/NeedlePaths.png  # 256 colours
