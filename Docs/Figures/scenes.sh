#!/bin/bash
# Docs/Figures/scenes.sh [SCENE...]: draws Docs/Pictures/<SCENE>.png for the named example scenes, or for all. It builds
# the scenes in build/demo. The pictures need no display.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."

declare -A options=(
  [OrganScene]="--frames 120"
  [FastNeedle]="--frames 6"
  [Palpation]="--frames 60"
  [LiverLift]="--frames 90 --size 830 519"
  [Suturing]="--frames 85"
  [Retraction]="--frames 75"
  [RobotArms]="--frames 170"
  [XRay]="--frames 20 --pixels 512"
  [BoneDrilling]="--frames 60 --particles 12000 --triangles 100000")
[[ $# -gt 0 ]] || set -- "${!options[@]}"

CMake/packages.sh build figures
cmake --preset release -DPALPATE_BUILD_TESTING=OFF -B build/demo >/dev/null
cmake --build build/demo --parallel "$(nproc)" --target "$@"
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
for scene in "$@"; do
  # shellcheck disable=SC2086
  xvfb-run -a "build/demo/Examples/$scene/$scene" ${options[$scene]} --out "$folder"
  [[ -e $folder/scene.png ]] || python3 -c "from PIL import Image; Image.open('$folder/scene.pgm').save('$folder/scene.png')"
  mv "$folder/scene.png" "Docs/Pictures/$scene.png"
done
