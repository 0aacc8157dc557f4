# That nothing intersects and no body drifts the program itself checks in each frame.
frames=8
long=1000
column contacts | awk '$1 > 50 { found = 1 } END { exit !found }' || fail "nothing touches"
for organ in liver stomach; do
  column "$organ volume share" | awk '$1 < 0.99 || $1 > 1.01 { exit 1 }' || fail "the $organ lost volume"
done
if [[ $length == long ]]; then
  column "folds touch" | awk '$1 > 100 { ++count } END { exit count < 100 }' || fail "the membrane does not meet itself"
fi
