# Methods, meshes of one's own, and refusals.
frames=40
run
grep -q "5 meshes, 11100 triangles, 10 pairs, auto" "$folder/text" || fail "the default is not auto: $(cat "$folder/text")"
grep -q "untrusted pairs\|narrow phase" "$folder/text" && fail "the short table has rows of stages: $(cat "$folder/text")"
run --stages --method proximity
column contacts | grep -qvx 0 || fail "no contacts"
for stage in frame collision boxes octree pairs "narrow phase" order; do
  grep -q "^$stage ms " "$folder/text" || fail "no line for $stage"
done
grep -qE "^untrusted pairs +[0-9.]+! .* 0\.000$" "$folder/text" || fail "no mark above the budget: $(cat "$folder/text")"
grep -q "^zero in all frames .*hold ms" "$folder/text" || fail "series of zeros are listed: $(cat "$folder/text")"
grep -q "5 meshes, 11100 triangles, 10 pairs, proximity" "$folder/run/report.html" || fail "report.html has not the settings"
[[ ! -s $folder/messages ]] || fail "a short run writes to a log: $(cat "$folder/messages")"
script -qec "'$program' --frames 3 --out '$folder/run'" /dev/null >"$folder/terminal" || fail "no terminal"
grep -q '\[#*\] OrganScene: frame 3 of 3, ' "$folder/terminal" || fail "no bar on a terminal: $(cat "$folder/terminal")"
for method in intersection proximity continuous auto; do
  run --method $method
  column contacts | grep -qvx 0 || fail "no contacts with $method"
done
refused --frames many
refused --thickness -1
refused --thickness nan
refused --method guess
grep -q '"guess" is none of auto, intersection, proximity, continuous' "$folder/messages" || fail "not in words: $(cat "$folder/messages")"
run --unit furlong
grep -q '"unit":"furlong"' "$folder/run/report.html" || fail "report.html has not the unit"
refused --method proximity --thickness 0
refused --mesh "$folder/missing.obj"
if [[ $hasVtk == 1 ]]; then
  organs=$(dirname "$test")/../../Data/Organs
  run --mesh "$organs/Liver.obj" "$organs/Kidney.obj"
  grep -q " 2 meshes, 5048 triangles, 1 pairs" "$folder/text" || fail "other meshes: $(head -1 "$folder/text")"
  column contacts | grep -qvx 0 || fail "meshes without contacts"
  echo "not a mesh" >"$folder/bad.obj"
  refused --mesh "$folder/bad.obj" "$organs/Liver.obj"
fi
