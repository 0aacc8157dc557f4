#!/bin/bash
# test.sh PROGRAM CAPTURES: Replay's answers and refusals.
set -uo pipefail
program=$1 captures=$2
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
fail() { echo "FAILED: $*"; exit 1; }

count=0
for file in "$captures"/*.capture; do
  "$program" "$file" --shrink "$folder/small" >"$folder/text" 2>"$folder/messages" || fail "$file: $(cat "$folder"/*)"
  grep -q "^0 of [1-9][0-9]* pairs differ" "$folder/text" || fail "$file: $(cat "$folder/text")"
  grep -q "^nothing to shrink" "$folder/text" || fail "$file: shrunk without need"
  [[ ! -e $folder/small ]] || fail "$file: something written"
  count=$((count + 1))
done
((count > 0)) || fail "no captures"

# Refused in one line, with a code of its own.
refused() {
  "$program" "$@" >"$folder/text" 2>"$folder/messages"
  [[ $? -eq 2 ]] || fail "not refused: $*"
  [[ $(wc -l <"$folder/messages") -eq 1 ]] || fail "not one line for $*: $(cat "$folder/messages")"
}
refused
refused --unknown
refused "$folder/missing"
grep -q "missing" "$folder/messages" || fail "the file is not named"
echo "not a capture" >"$folder/bad"
refused "$folder/bad"
head -c 60 "$file" >"$folder/cut"
refused "$folder/cut"
echo passed
