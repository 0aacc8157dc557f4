# That no features pass through each other the program itself checks for each step.
frames=80
long=240
column contacts | awk '$1 > 0 { found = 1 } END { exit !found }' || fail "nothing touches"
[[ $length != long ]] || column "tip mm" | tail -1 | awk '{ exit $1 > -8 }' || fail "the thread is not through"
