#!/bin/bash
# test.sh CPP C: both programs print the same.
set -euo pipefail
diff <("$1") <("$2")
[[ -n $("$2") ]]
