#!/bin/bash
# CMake/coverage.sh: builds the core and its tests with counters, runs them, prints the coverage of each module and writes
# it to Docs/Notes/Coverage.md. Exit code 1 if a branch of Math, Octree, Contact or NarrowPhase is neither reached nor explained in
# Testing/Coverage/explained.txt. build/coverage/html/index.html shows each line. Arguments go to ctest.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

jobs=$(nproc)
out=build/coverage
CMake/packages.sh build test matrix coverage
cmake --preset coverage >/dev/null
cmake --build --preset coverage --parallel "$jobs"
find $out -name '*.gcda' -delete
ctest --preset coverage --parallel "$jobs" "$@"
rm -rf $out/merged $out/html
mkdir $out/html
/usr/bin/python3 Testing/Coverage/merge.py $out $out/merged
gcovr --use-gcov-files --keep --root . --exclude-unreachable-branches --exclude-throw-branches --json $out/coverage.json \
  --html-details $out/html/index.html $out/merged
/usr/bin/python3 Testing/Coverage/report.py $out/coverage.json
