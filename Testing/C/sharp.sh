#!/bin/bash
# sharp.sh EXAMPLE TEST OUT LIBRARY SIZES HELLO: compiles Palpate.cs with the example's program and with Layouts.cs. The
# program prints what HELLO prints, and structs have in C# the sizes that SIZES prints.
set -euo pipefail
example=$1 test=$2 out=$3 library=$4 sizes=$5 hello=$6
for tool in mcs mono; do
  command -v $tool >/dev/null || { echo "skipped: $tool is not installed (packages mono-mcs, mono-runtime)"; exit 77; }
done
export LD_LIBRARY_PATH=$(dirname "$library")
mcs -unsafe -warnaserror -out:"$out/HelloCollision.exe" "$example/Palpate.cs" "$example/HelloCollision.cs"
diff <("$hello") <(mono "$out/HelloCollision.exe")
mcs -unsafe -warnaserror -out:"$out/Layouts.exe" "$example/Palpate.cs" "$test/Layouts.cs"
mono "$out/Layouts.exe" >"$out/layouts.txt"
[[ $(wc -l <"$out/layouts.txt") -ge 23 ]]
# Each line of C# is one of C.
! "$sizes" | LC_ALL=C sort | LC_ALL=C comm -13 - "$out/layouts.txt" | grep .
