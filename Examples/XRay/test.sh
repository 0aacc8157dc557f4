#!/bin/bash
# test.sh PROGRAM: the program itself compares the organs' volumes in each image with those of their meshes.
set -uo pipefail
program=$1
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
fail() { echo "FAILED: $*"; exit 1; }
run() { "$program" --frames 20 --pixels 128 "$@" >"$folder/text" || fail "$*"; }

for threads in 1 2 8; do run --threads $threads --out "$folder/$threads"; done
cmp "$folder/1/scene.pgm" "$folder/2/scene.pgm" && cmp "$folder/1/scene.pgm" "$folder/8/scene.pgm" || fail "threads change the image"
[[ $(wc -c <"$folder/1/scene.pgm") -eq $((15 + 128 * 128)) ]] || fail "the image has not 128 x 128 pixels"
[[ $(tail -c $((128 * 128)) "$folder/1/scene.pgm" | od -An -v -tu1 -w1 | sort -nu | wc -l) -gt 100 ]] || fail "the image has few shades"
grep -q "^image ms .*budget ms 33.3" "$folder/text" || fail "no times beside the budget"
"$program" --pixels 3 >/dev/null 2>&1 && fail "3 pixels are not refused"
"$program" --frames 1 --out "$folder/text/none" >/dev/null 2>"$folder/messages" && fail "a folder inside a file"
[[ $(wc -l <"$folder/messages") -eq 1 ]] || fail "not one line: $(cat "$folder/messages")"
echo passed
