# That a mesh handed over anew has the same contacts, and that the predicate filters the rim alone, the program checks.
frames=30
options="--check"
long=150
column "split vertices" | awk '{ sum += $1 } END { exit sum < 25 }' || fail "the blade cuts nothing"
column "removed tetrahedra" | awk '{ sum += $1 } END { exit sum < 8 }' || fail "the needle cuts no hole"
column "blade touches" | awk '$1 > 5 { found = 1 } END { exit !found }' || fail "the blade touches no flap"
if [[ $length == long ]]; then
  column "flaps touch" | tail -1 | awk '$1 < 10 { exit 1 }' || fail "the flaps do not meet"
else
  column "filtered contacts" | awk '$1 > 5 { found = 1 } END { exit !found }' || fail "the thread is not at the rim"
fi
