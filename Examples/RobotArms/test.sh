# That no link ends a frame inside another, in an organ or outside the cavity the program itself checks in each frame.
frames=170
long=480
column "least distance mm" | awk '$1 <= 0 { exit 1 }' || fail "shapes touch"
column "arms touch" | awk '$1 > 0 { ++count } END { exit count < 5 }' || fail "the arms do not meet"
column "organs touch" | awk '$1 > 0 { ++count } END { exit count < 5 }' || fail "no organ is met"
column held | awk '{ sum += $1 } END { exit sum > NR / 50 }' || fail "the arms are stuck"
