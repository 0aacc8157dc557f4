#!/bin/bash
# testScene.sh PROGRAM TEST HAS_VTK LENGTH: what every scene's program does, and what its own test.sh adds.
# That says how many frames are enough (frames=N), with which options (options=...), and how many the whole story
# has (long=N, without them), frames or long being LENGTH; it may use program, folder, hasVtk, length, fail, refused, run and column.
set -uo pipefail
program=$1 test=$2 hasVtk=$3 length=$4
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
fail() { echo "FAILED: $*"; exit 1; }
unset DISPLAY

# Refused in one line, with a code, and nothing written.
refused() {
  "$program" --frames 1 --out "$folder/refused" "$@" >"$folder/text" 2>"$folder/messages"
  [[ $? -eq 2 ]] || fail "not refused: $*"
  grep -qE 'CLI::|ENUM|->|INT|FAILED' "$folder/messages" && fail "not in words: $(cat "$folder/messages")"
  [[ $(wc -l <"$folder/messages") -eq 1 ]] || fail "not one line for $*: $(cat "$folder/messages")"
  [[ ! -e $folder/refused ]] || fail "something written for $*"
}
# column NAME: its values in the run's frames.csv, a line each.
column() {
  awk -F, -v name="$1" 'NR == 1 { for (i = 1; i <= NF; ++i) if ($i == name) at = i; if (!at) exit 1; next } { print $at }' \
    "$folder/run/frames.csv" || fail "no column $1"
}
run() { "$program" $options --frames "$frames" --out "$folder/run" "$@" >"$folder/text" 2>"$folder/messages" || fail "$(cat "$folder/messages")"; }

frames=$(sed -n "s/^$length=//p" "$test")
options=
[[ $length == long ]] || options=$(sed -n 's/^options=//p' "$test" | tr -d '"')
run --threads 1
hash=$(grep "result hash" "$folder/text")
run
[[ $(grep "result hash" "$folder/text") == "$hash" ]] || fail "threads change the result"
[[ $(wc -l <"$folder/run/frames.csv") -eq $((frames + 1)) ]] || fail "frames.csv has not a line per frame"
grep -q "${hash##* }" "$folder/run/report.html" || fail "report.html has not the hash"
grep -qE '(src|href)="?http' "$folder/run/report.html" && fail "report.html needs a network"
[[ $(stat -c %s "$folder/run/report.html") -le 8000000 ]] || fail "report.html is larger than 8 MB"
if [[ $length == long || $program == */OrganScene ]]; then  # all reports have the same page
  python3 "$(dirname "$0")/../../Testing/Common/report.py" "$folder/run/report.html" || fail "report.html in a browser"
fi
grep -q "no picture" "$folder/text" || fail "nothing said about the picture"
"$program" $options --frames 2 --paraview --out "$folder/series" >"$folder/text" || fail "the series"
[[ $(grep -c '<DataSet' "$folder"/series/paraview/*.pvd) -eq 6 ]] || fail "the .pvd has not three parts of two frames"
[[ $(ls "$folder"/series/paraview/*.vtp | wc -l) -eq 6 && ! -e $folder/series/paraview.part ]] || fail "not six .vtp files"
if [[ $hasVtk == 1 ]]; then
  refused --view
  grep -q display "$folder/messages" || fail "the display that is not there is not named"
  refused --pictures 0 1
  refused --size 0 100
  refused --size 100
  refused --keys nx
  grep -q "the window has no key x" "$folder/messages" || fail "the key is not named: $(cat "$folder/messages")"
fi
refused --frames 0
grep -q -- '--frames: "0" is not a whole number from 1 to 1000000; see --help$' "$folder/messages" || fail "not in words: $(cat "$folder/messages")"
refused --frames some
refused --frames
refused --unknown
refused --threads -1
touch "$folder/file"
"$program" --frames 1 --out "$folder/file/run" 2>"$folder/messages" && fail "a folder inside a file"
grep -q "cannot be made" "$folder/messages" || fail "the folder is not named: $(cat "$folder/messages")"
. "$test"
echo passed
