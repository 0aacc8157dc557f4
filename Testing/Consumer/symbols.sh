#!/bin/bash
# symbols.sh LIBRARY: the C++ symbols that the library exports are those of symbols.txt, so that a change of the binary interface is
# a decision. WRITE=1 writes the list. Testing/C/abi.sh has the C interface.
set -euo pipefail
list=$(dirname "${BASH_SOURCE[0]}")/symbols.txt
found=$(nm --dynamic --defined-only --format=just-symbols "$1" | sed 's/@@.*//' | grep -v '^palpate_\|^PALPATE_' | c++filt | LC_ALL=C sort)
[[ ${WRITE:-} ]] && printf '%s\n' "$found" >"$list"
diff --unified=0 "$list" <(printf '%s\n' "$found") && exit 0
echo "Lines with - are missing, lines with + are new. If both are meant: WRITE=1 bash Testing/Consumer/symbols.sh LIBRARY" >&2
exit 1
