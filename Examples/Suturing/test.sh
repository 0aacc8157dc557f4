# That the thread never passes through itself the program itself checks for each committed step.
frames=35
long=400
[[ $(column holes | tail -1) -ge 1 ]] || fail "the needle pierced nothing"
column stretch | awk '$1 > 1.1 { exit 1 }' || fail "the thread is stretched"
column "knot gap mm" | tail -1 | awk '$1 <= 0 || $1 >= 0.02 { exit 1 }' || fail "the knot is not tight"
[[ $(column "end through loop" | tail -1) == 1 ]] || fail "the end is not through the loop of the knot"
[[ $(column "stitched edges" | tail -1) == 2 ]] || fail "the stitch does not hold both edges"
report=$folder/run/report.html
grep -q "end, loop of the knot: through in step [89][0-9] (EndPassed, thread 0-0)" "$report" ||
  fail "the report does not grade the end's way through the loop"
if [[ $length == long ]]; then
  [[ $(column holes | tail -1) == 2 ]] || fail "the needle pierced one sheet only"
  grep -q "needle, right edge: through in step " "$report" || fail "the thread is not through the second edge"
  column substeps | tail -1 | awk '{ exit $1 < 1000 }' || fail "the needle was held for good"
  [[ $(column "touches itself" | tail -1) -ge 3 ]] || fail "the thread does not hold itself"
else
  refused --fault rain
  declare -A events=([wall]="Passed, thread [0-9]+-[0-9]+, loop [0-9]+-[0-9]+" [end]="EndPassed, thread 0-0" [disabled]=Disabled)
  for fault in wall end disabled; do
    run --fault $fault
    grep -qE "^end, loop of the knot: lost in step 1[23][0-9] \(${events[$fault]}\)$" "$folder/text" ||
      fail "the fault $fault is not graded: $(grep "of the knot:" "$folder/text")"
  done
fi
