# That no particle is inside the bone or an organ, and that the burr stays out, the program itself checks in each frame.
frames=70
options="--particles 2000 --triangles 30000"
long=120
column touching | tail -20 | awk '$1 > 10 { ++count } END { exit count < 15 }' || fail "nothing falls on anything"
column "burr distance mm" | awk '$1 < 0.1 { ++count } END { exit count < 10 }' || fail "the burr does not reach the bone"
column rebuilt | tail -n +2 | awk '$1 > 2 { exit 1 }' || fail "more than the particles' octree is built anew in a substep"
column "fallen" | awk '{ sum += $1 } END { exit sum < 1 }' || fail "nothing falls off"
refused --particles 0
refused --triangles 10
