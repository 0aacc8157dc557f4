#!/bin/bash
# test.sh PROGRAM: checks SpeedAccuracy's CSV and page, and that a run continues where the last one stopped.
set -uo pipefail
program=$1
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
fail() { echo "FAILED: $*"; exit 1; }

run() { "$program" --out "$folder/run" --scenes needle --frames 9 --methods Intersection,Continuous,Auto --repetitions 1 "$@"; }
run >"$folder/text" 2>"$folder/messages" || fail "the first run: $(cat "$folder/messages")"
csv=$folder/run/speed-accuracy.csv
rows=$(($(wc -l <"$csv") - 1))
((rows >= 7)) || fail "only $rows rows"
cell() { awk -F, -v method="$1" -v setting="$2" -v column="$3" \
  'NR == 1 { for (i = 1; i <= NF; ++i) if ($i == column) c = i } $2 == method && $3 == setting { print $c }' "$csv"; }
[[ $(cell Continuous exact new_false_negatives) == 0 ]] || fail "Continuous has false negatives"
[[ $(cell Continuous exact false_positives) == 0 ]] || fail "Continuous has false positives"
[[ $(cell Auto '1/20 edge' false_negatives) == 0 ]] || fail "Auto has false negatives"
awk "BEGIN { exit !($(cell Intersection 'once a frame' new_false_negatives) > 30) }" || fail "the needle does not tunnel"

page=$folder/run/report.html
grep -q '"fast needle","Continuous","exact"' "$page" || fail "the page has no figures"
grep -qE '(src|href)="|https?://[^w]' "$page" && fail "the page refers to other files"
if command -v node >/dev/null; then  # checks the syntax of the page's script and data
  node -e '
    const page = require("fs").readFileSync(process.argv[1], "utf8");
    const scripts = [...page.matchAll(/<script[^>]*>([\s\S]*?)<\/script>/g)].map(match => match[1]);
    if (JSON.parse(scripts[0]).rows.length !== Number(process.argv[2])) process.exit(1);
    new Function(scripts[1]);' "$page" "$rows" || fail "syntax of the page's script or data"
fi

# If the last row is lost, only that row is measured again.
sed -i '$d' "$csv"
kept=$(md5sum <"$csv")
run >"$folder/text" 2>"$folder/messages" || fail "the second run: $(cat "$folder/messages")"
[[ $(head -n "$rows" "$csv" | md5sum) == "$kept" ]] || fail "earlier rows have changed"
(($(wc -l <"$csv") == rows + 1)) || fail "the lost row is not back"
(($(grep -c '% false negatives' "$folder/text") == 1)) || fail "more than the lost row was measured"

# Fields and proxies at a small bone: no error beyond the stated one.
"$program" --out "$folder/rigid" --scenes bone --bone 5000 --particles 500 >"$folder/text" 2>"$folder/messages" ||
  fail "rigid bodies: $(cat "$folder/messages")"
[[ $(wc -l <"$folder/rigid/rigid-bodies.csv") -eq 20 ]] || fail "rows are missing: $(cat "$folder/text")"

# Contacts that are missed within a budget: shares, which depend on the clock.
"$program" --out "$folder/budgets" --scenes bone --bone 5000 --particles 500 --methods Proxy --budget-frames 1 >"$folder/text" 2>"$folder/messages" ||
  fail "budgets: $(cat "$folder/messages")"
awk -F, 'NR > 1 { for (i = 2; i <= 6; ++i) if (!($i >= 0 && $i <= 120)) bad = 1 } END { exit bad || NR != 25 }' \
  "$folder/budgets/budgets.csv" || fail "figures of budgets: $(cat "$folder/budgets/budgets.csv")"

# Refused in one line, and nothing written.
refused() {
  "$program" --out "$folder/refused" "$@" >"$folder/text" 2>"$folder/messages"
  [[ $? -eq 2 && $(wc -l <"$folder/messages") -eq 1 && ! -e $folder/refused ]] || fail "not refused: $*: $(cat "$folder/messages")"
}
refused --frames 0
refused --scenes needel
grep -q 'there is no scene "needel", but .*fast needle' "$folder/messages" || fail "scenes are not named: $(cat "$folder/messages")"
refused --methods Guess
echo passed
