# That nothing intersects and no body drifts the program itself checks in each frame.
frames=16
long=1000
column contacts | awk '$1 > 50 { found = 1 } END { exit !found }' || fail "nothing touches"
for organ in liver stomach; do
  column "$organ volume share" | awk '$1 < 0.99 || $1 > 1.01 { exit 1 }' || fail "the $organ lost volume"
done
column "force N" | sort -g | tail -1 | awk '$1 < 0.05 { exit 1 }' || fail "nothing is lifted"
if [[ $length == long ]]; then
  column "force N" | sort -g | tail -1 | awk '$1 < 1 || $1 > 20 { exit 1 }' || fail "no force of a retraction"
fi
