#!/bin/bash
# abi.sh LIST LIBRARY SIZES HEADER: the library exports the functions of the list, with these versions, and the header
# declares them; SIZES prints the structs' sizes. To accept a change, write what this prints into the list.
set -euo pipefail
now=$({ nm -D --defined-only "$2" | awk '/ palpate_/ {print $3}' && "$3"; } | LC_ALL=C sort)
diff -u --label "$1" "$1" --label "this build" <(echo "$now")
diff <(grep -oE '^palpate_[a-z_]+@' "$1" | tr -d @) <(
  grep -E '^PALPATE_EXPORT' "$4" | grep -oE 'palpate_[a-z_]+\(' | tr -d '(' | LC_ALL=C sort)
