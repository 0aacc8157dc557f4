#!/bin/bash
# test.sh PROGRAM: the forces of the haptic loop in lockstep, and that both threads run. Times are not tested.
set -uo pipefail
program=$1
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
fail() { echo "FAILED: $*"; exit 1; }

"$program" --strokes 1 --lockstep --out "$folder/a" >"$folder/text" || fail "lockstep: $(cat "$folder/text")"
hash=$(grep "result hash" "$folder/text")
"$program" --strokes 1 --lockstep >"$folder/again" || fail "lockstep without files"
[[ $(grep "result hash" "$folder/again") == "$hash" ]] || fail "another run has other forces"
grep -qE "^[1-9][0-9]{2,} ticks in touch" "$folder/text" || fail "the tool does not touch: $(cat "$folder/text")"
grep -q "^largest jumps beyond the tool's own motion: " "$folder/text" || fail "no jumps: $(cat "$folder/text")"
grep -q "^force jump,2000," "$folder/a/haptics.csv" || fail "haptics.csv: $(cat "$folder/a/haptics.csv")"
grep -q "<polyline" "$folder/a/haptics.svg" || fail "haptics.svg has no lines"

"$program" --strokes 1 --seconds 1 --out "$folder/b" >"$folder/text" # 1: late snapshots may make the force jump
[[ $? == [01] ]] || fail "threads: $(cat "$folder/text")"
grep -q "^haptic step,1000," "$folder/b/haptics.csv" || fail "not 1000 steps: $(cat "$folder/b/haptics.csv")"
grep -qE "snapshot ([2-9]|[1-9][0-9]+) was the last" "$folder/text" || fail "too few snapshots: $(cat "$folder/text")"

"$program" --strokes 0 >"$folder/text" 2>"$folder/messages"
[[ $? -eq 2 ]] || fail "--strokes 0 is not refused"
touch "$folder/file"
"$program" --strokes 1 --lockstep --seconds 1 --out "$folder/file/run" >"$folder/text" 2>"$folder/messages" && fail "a folder inside a file"
echo passed
