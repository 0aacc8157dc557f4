# That the jaws and the gallbladder are never in the liver the program itself checks in each frame.
frames=40
long=150
column "grip contacts" | tail -1 | awk '$1 < 10 { exit 1 }' || fail "the jaws hold nothing"
column "volume share" | awk '$1 < 0.99 || $1 > 1.01 { exit 1 }' || fail "the liver lost volume"
if [[ $length == long ]]; then
  column "lift mm" | sort -g | tail -1 | awk '$1 < 15 { exit 1 }' || fail "the edge is not lifted"
  column "force N" | sort -g | tail -1 | awk '$1 < 0.5 || $1 > 20 { exit 1 }' || fail "no force of a retraction"
fi
