# That the thread never passes through itself the program itself checks for each committed step.
frames=16
long=400
[[ $(column holes | tail -1) -ge 1 ]] || fail "the needle pierced nothing"
column stretch | awk '$1 > 1.1 { exit 1 }' || fail "the thread is stretched"
column "knot gap mm" | awk '$1 <= 0 || $1 >= 0.02 { exit 1 }' || fail "the knot is not tied"
if [[ $length == long ]]; then
  [[ $(column holes | tail -1) == 2 ]] || fail "the needle pierced one sheet only"
  [[ $(column substeps | tail -1) -ge 1000 ]] || fail "the needle was held for good"
  [[ $(column "touches itself" | tail -1) -ge 3 ]] || fail "the thread does not hold itself"
fi
