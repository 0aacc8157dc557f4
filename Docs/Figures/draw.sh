#!/bin/bash
# Docs/Figures/draw.sh: draws all charts and diagrams of the documentation into Docs/Pictures, from the CSV files in Docs/Data.
# Needs the packages of `CMake/packages.sh figures`, and no network. The same CSV files give the same pictures.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")"

python=/usr/bin/python3  # the interpreter of Debian's packages
mkdir -p ../Pictures
"$python" speedAccuracy.py ../Data/SpeedAccuracy.csv ../Pictures/SpeedAccuracy
"$python" fastNeedle.py ../Data/SpeedAccuracy.csv ../Pictures/FastNeedleSpeed
"$python" distanceFields.py ../Data/DistanceFields.csv ../Pictures/DistanceFields
"$python" rigidBodies.py ../Data/RigidBodies.csv ../Pictures/RigidBodies
[[ ! -f ../Data/Budgets.csv ]] || "$python" budgets.py ../Data/Budgets.csv ../Pictures/Budgets
"$python" performance.py ../Data/Performance.csv ../Pictures
"$python" stability.py ../Data/Stability.csv ../Pictures/Stability
"$python" forceCurve.py ../Data/ForceCurve.csv ../Pictures/ForceCurve
"$python" smoothNormals.py ../Data/SmoothNormals.csv ../Pictures/SmoothNormals
if [[ -f diagrams.py ]]; then
  "$python" diagrams.py
fi
