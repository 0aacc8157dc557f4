#!/bin/bash
# test.sh PROGRAM: SpeedAccuracy's figures, its page, and that a run goes on where the last one stopped.
set -uo pipefail
program=$1
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
fail() { echo "FAILED: $*"; exit 1; }
export DISPLAY=  # none; pictures are shown by CMake/speed-accuracy.sh

run() { "$program" --out "$folder/run" --scenes needle --frames 9 --methods Intersection,Continuous,Auto --repetitions 1 "$@"; }
run >"$folder/text" 2>"$folder/messages" || fail "the run: $(cat "$folder/messages")"
csv=$folder/run/speed-accuracy.csv
rows=$(($(wc -l <"$csv") - 1))
((rows >= 7)) || fail "only $rows rows"
cell() { awk -F, -v method="$1" -v setting="$2" -v column="$3" \
  'NR == 1 { for (i = 1; i <= NF; ++i) if ($i == column) c = i } $2 == method && $3 == setting { print $c }' "$csv"; }
[[ $(cell Continuous exact new_missed) == 0 ]] || fail "Continuous misses new contacts"
[[ $(cell Continuous exact invented) == 0 ]] || fail "Continuous invents contacts"
[[ $(cell Auto '1/20 edge' missed) == 0 ]] || fail "Auto misses contacts"
awk "BEGIN { exit !($(cell Intersection 'once a frame' new_missed) > 30) }" || fail "the needle does not tunnel"

page=$folder/run/report.html
grep -q '"fast needle","Continuous","exact"' "$page" || fail "the page has no figures"
grep -qE '(src|href)="|https?://[^w]' "$page" && fail "the page reaches out"
if command -v node >/dev/null; then  # the script of the page and its data are well formed
  node -e '
    const page = require("fs").readFileSync(process.argv[1], "utf8");
    const scripts = [...page.matchAll(/<script[^>]*>([\s\S]*?)<\/script>/g)].map(match => match[1]);
    if (JSON.parse(scripts[0]).rows.length !== Number(process.argv[2])) process.exit(1);
    new Function(scripts[1]);' "$page" "$rows" || fail "the page's script or data"
fi

# The last row is lost: it alone is measured again.
sed -i '$d' "$csv"
kept=$(md5sum <"$csv")
run >"$folder/text" 2>"$folder/messages" || fail "the second run: $(cat "$folder/messages")"
[[ $(head -n "$rows" "$csv" | md5sum) == "$kept" ]] || fail "what was measured has changed"
(($(wc -l <"$csv") == rows + 1)) || fail "the lost row is not back"
(($(grep -c '% missed' "$folder/text") == 1)) || fail "more than the lost row was measured"

"$program" --frames 0 >"$folder/text" 2>&1 && fail "not refused: --frames 0"
[[ $(wc -l <"$folder/text") -le 2 ]] || fail "a long refusal: $(cat "$folder/text")"
echo passed
