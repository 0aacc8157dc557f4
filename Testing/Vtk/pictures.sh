#!/bin/bash
# pictures.sh COMPARE XVFB_RUN PICTURES PROGRAM [OPTION...]: the picture that a scene's program draws beside its reference,
# PICTURES/NAME.png. With WRITE=1 it becomes the reference: look at it first, it is kept as PICTURES/NAME.large.png.
set -uo pipefail
compare=$1 xvfb=$2 pictures=$3 program=$4
shift 4
name=$(basename "$program")
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
fail() { echo "FAILED: $*"; exit 1; }
"$xvfb" -a "$program" "$@" --size 800 500 --threads 1 --out "$folder" >"$folder/text" 2>&1 || fail "$(cat "$folder/text")"
if [[ ${WRITE:-0} == 1 ]]; then
  cp "$folder/scene.png" "$pictures/$name.large.png"
  "$compare" "$pictures/$name.png" "$folder/scene.png" --write
  exit
fi
"$compare" "$pictures/$name.png" "$folder/scene.png" || fail "$name looks different"
for other in "$pictures"/*.png; do  # and the others' references are not taken for it
  [[ $other == */$name.png ]] || ! "$compare" "$other" "$folder/scene.png" >/dev/null || fail "$name passes for $other"
done
echo passed
