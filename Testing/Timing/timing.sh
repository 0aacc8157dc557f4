#!/bin/bash
# timing.sh PROGRAM...: runs each scene for 300 frames (FRAMES says otherwise) and prints median, p99 and worst of its
# stages, in milliseconds, beside its budget, and the share of frames within it. Fails only if a scene does.
set -uo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
for program in "$@"; do
  "$program" --frames "${FRAMES:-300}" --out "$folder" >"$folder/text" || { echo "FAILED: $program"; exit 1; }
  grep -E "frames$|median| ms " "$folder/text"
  budget=$(awk '/^frame ms/ { print $6 }' "$folder/text")
  awk -F, -v budget="$budget" 'NR > 1 { ++frames; within += $2 <= budget }
    END { printf "%d of %d frames within %s ms\n\n", within, frames, budget }' "$folder/frames.csv"
done
