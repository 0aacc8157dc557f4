#!/bin/bash
# test.sh PROGRAM ORGANS HAS_VTK: OrganScene's figures, files and refusals.
set -uo pipefail
program=$1 organs=$2 hasVtk=$3
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
fail() { echo "FAILED: $*"; exit 1; }
unset DISPLAY  # the picture has its own test

"$program" --frames 40 --out "$folder/run" >"$folder/text" 2>"$folder/messages" || fail "the run: $(cat "$folder/messages")"
for stage in boxes octree pairs "narrow phase" order "whole frame" "candidate pairs" contacts "result hash"; do
  grep -q "^$stage " "$folder/text" || fail "no line for $stage"
done
[[ $(wc -l <"$folder/run/frames.csv") -eq 41 ]] || fail "frames.csv has not a line per frame"
awk -F, 'NR > 1 && $10 > 0 { found = 1 } END { exit !found }' "$folder/run/frames.csv" || fail "no contacts"
grep -q "no picture" "$folder/text" || fail "nothing said about the picture"

"$program" --frames 40 --threads 1 --out "$folder/one" >"$folder/one.text" || fail "the run with one thread"
[[ $(grep "result hash" "$folder/text") == $(grep "result hash" "$folder/one.text") ]] || fail "threads change the result"

for method in intersection proximity continuous; do
  "$program" --frames 40 --method $method --out "$folder/$method" >"$folder/text" || fail "the run with $method"
  awk -F, 'NR > 1 && $10 > 0 { found = 1 } END { exit !found }' "$folder/$method/frames.csv" || fail "no contacts with $method"
done

# Refused in one line, with a code, and nothing written.
refused() {
  "$program" --out "$folder/refused" "$@" >"$folder/text" 2>"$folder/messages" && fail "not refused: $*"
  [[ $(wc -l <"$folder/messages") -eq 1 ]] || fail "not one line for $*: $(cat "$folder/messages")"
  [[ ! -e $folder/refused ]] || fail "something written for $*"
}
refused --frames 0
refused --frames many
refused --thickness -1
refused --thickness nan
refused --method guess
refused --method proximity --thickness 0
refused --threads -1
refused --unknown
refused --mesh "$folder/missing.obj"
touch "$folder/file"
"$program" --frames 1 --out "$folder/file/run" 2>"$folder/messages" && fail "a folder inside a file"
grep -q "cannot be made" "$folder/messages" || fail "the folder is not named: $(cat "$folder/messages")"

if [[ $hasVtk == 1 ]]; then
  "$program" --frames 30 --out "$folder/meshes" --mesh "$organs/Liver.obj" "$organs/Kidney.obj" >"$folder/text" ||
    fail "the run on meshes"
  grep -q "^2 meshes, 4420 triangles, 1 pairs" "$folder/text" || fail "other meshes: $(head -1 "$folder/text")"
  awk -F, 'NR > 1 && $10 > 0 { found = 1 } END { exit !found }' "$folder/meshes/frames.csv" || fail "meshes without contacts"
  echo "not a mesh" >"$folder/bad.obj"
  refused --mesh "$folder/bad.obj" "$organs/Liver.obj"
fi
echo passed
