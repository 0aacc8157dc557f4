# That no vertex is inside the probe the program itself checks in each frame.
frames=30
long=300
column "force mN" | awk '$1 > 1 { found = 1 } END { exit !found }' || fail "nothing is pressed"
column "volume share" | awk '$1 < 0.97 || $1 > 1.03 { exit 1 }' || fail "the organ lost volume"
refused --mesh "$folder/missing.obj"
refused --tool "$folder/missing.obj"
if [[ $hasVtk == 1 ]]; then
  printf 'v 0 0 0\nv 9 0 0\nv 0 9 0\nf 1 2 3\n' >"$folder/open.obj"
  refused --tool "$folder/open.obj"
  grep -q "open.obj" "$folder/messages" || fail "the open mesh is not named"
  printf 'v 0 0 0\nv 9 0 20\nv -9 9 20\nv -9 -9 20\nf 1 3 2\nf 1 4 3\nf 1 2 4\nf 2 3 4\n' >"$folder/tool.obj"
  run --tool "$folder/tool.obj"
  column "force mN" | awk '$1 > 1 { found = 1 } END { exit !found }' || fail "the tool presses nothing"
fi
