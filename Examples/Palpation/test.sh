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
  instrument=${PALPATE_SHARED_DATA:-}/meshes/dental_instrument.obj
  if [[ -e $instrument ]]; then  # 7 long and open at its ends: made 90 mm long, its rims closed
    awk '$1 == "v" { ++n; for (i = 1; i <= 3; ++i) p[n, i] = 13 * $(i + 1); print "v", p[n, 1], p[n, 2], p[n, 3] }
      $1 == "f" { for (i = 1; i <= 3; ++i) { split($(i + 1), id, "/"); c[i] = id[1] }
        print "f", c[1], c[2], c[3]
        for (i = 1; i <= 3; ++i) edge[c[i], c[i % 3 + 1]] = 1 }
      END { for (e in edge) { split(e, id, SUBSEP); if (!((id[2], id[1]) in edge)) rim[id[1]] = id[2] }
        for (a in rim) {
          count = split("", sum)
          for (b = a; !(b in seen); b = rim[b]) { seen[b] = 1; ring[++count] = b; for (i = 1; i <= 3; ++i) sum[i] += p[b, i] }
          if (!count) continue
          print "v", sum[1] / count, sum[2] / count, sum[3] / count; ++n
          for (i = 1; i <= count; ++i) print "f", rim[ring[i]], ring[i], n
        } }' "$instrument" >"$folder/instrument.obj"
    run --tool "$folder/instrument.obj"
    column "force mN" | awk '$1 > 1 { found = 1 } END { exit !found }' || fail "the instrument presses nothing"
  else
    echo "skipped: no $instrument"
  fi
fi
