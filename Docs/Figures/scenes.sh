#!/bin/bash
# Docs/Figures/scenes.sh [SCENE...]: draws Docs/Pictures/<SCENE>.png for the named example scenes, or for all. It builds
# the scenes in build/demo. The pictures need no display.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."

size="--size 1200 750"
declare -A options=(
  [OrganScene]="$size --frames 120"
  [FastNeedle]="$size --frames 6"
  [Palpation]="$size --frames 60"
  [LiverLift]="$size --frames 90"
  [Suturing]="$size --frames 58"
  [Cutting]="$size --frames 75"
  [Retraction]="$size --frames 75"
  [RobotArms]="$size --frames 170"
  [XRay]="--frames 20 --pixels 512"
  [BoneDrilling]="$size --frames 60 --particles 12000 --triangles 100000")
[[ $# -gt 0 ]] || set -- "${!options[@]}"

CMake/packages.sh build figures
cmake --preset release -DPALPATE_BUILD_TESTING=OFF -B build/demo >/dev/null
cmake --build build/demo --parallel "$(nproc)" --target "$@"
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
for scene in "$@"; do
  # shellcheck disable=SC2086
  xvfb-run -a "build/demo/Examples/$scene/$scene" ${options[$scene]} --out "$folder"
  [[ -e $folder/scene.png ]] || /usr/bin/python3 -c "from PIL import Image; Image.open('$folder/scene.pgm').save('$folder/scene.png')"
  pngquant --speed 1 --strip --force --output "Docs/Pictures/$scene.png" "$folder/scene.png"  # 256 colours
done
