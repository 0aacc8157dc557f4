#!/bin/bash
# test.sh PROGRAM CAPTURES [FAULT]: what Replay prints and refuses. FAULT is a library that, loaded first, makes octrees
# lose contacts. With it the script tests what Replay shrinks, too.
set -uo pipefail
program=$1 captures=$2 fault=${3-}
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

# Two strips of 60 triangles, one above the other.
strips() {
  awk 'BEGIN {
    print "palpate-capture 1\nOctree 1 32 16 Auto\n2 1"
    for (g = 0; g < 2; ++g) {
      print "geometry", g, 62, 60
      for (i = 0; i < 62; ++i) printf "%x %x %x %x %x %x\n", i, i % 2, g, i, i % 2, g
      for (t = 0; t < 60; ++t) print t, t + 1, t + 2
    }
    print "pair 0 1 Proximity Proximity 1.8p+0 All\nend"
  }'
}
if [[ -n $fault ]]; then
  strips >"$folder/strips.capture"
  "$program" "$folder/strips.capture" >"$folder/text" || fail "differs without a fault: $(cat "$folder/text")"
  LD_PRELOAD=$fault "$program" "$folder/strips.capture" --shrink "$folder/small.capture" >"$folder/text"
  [[ $? -eq 1 ]] || fail "the fault was not found: $(cat "$folder/text")"
  grep -q "false negative in edgeEdge: edge" "$folder/text" || fail "the false negative is not named: $(cat "$folder/text")"
  grep -q "^2 of 120 triangles still differ" "$folder/text" || fail "not shrunk: $(tail -1 "$folder/text")"
  LD_PRELOAD=$fault "$program" "$folder/small.capture" >"$folder/text"
  [[ $? -eq 1 ]] || fail "the smaller problem does not differ: $(cat "$folder/text")"
  "$program" "$folder/small.capture" >"$folder/text" || fail "it differs without the fault"
fi

# Refused calls print one line and have their own exit code.
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
