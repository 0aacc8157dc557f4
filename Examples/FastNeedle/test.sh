# Proximity lets the needle through unseen; that the others do not, the program itself checks in each frame.
frames=6
[[ $(column "Proximity passed" | tail -1) == 1 ]] || fail "Proximity held the needle"
column "Proximity contacts" | grep -qvx 0 && fail "Proximity saw the needle"
for lane in Continuous Auto; do
  column "$lane contacts" | grep -qvx 0 || fail "$lane saw no needle"
done
