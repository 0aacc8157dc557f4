#!/bin/bash
# From nothing to the whole table of Docs/Performance.md: packages, the benchmark preset, the race, its CSV.
# Arguments go to palpate_race (--help lists them), for example: --scenes organs,cloth --threads 1
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

CMake/packages.sh build benchmark
cmake --preset benchmark
cmake --build --preset benchmark --parallel "$(nproc)"
csv=build/benchmark/race.csv
build/benchmark/Testing/Benchmark/palpate_race --csv $csv \
  --commit "$(git describe --always --dirty 2>/dev/null || echo unknown)${*:+ ${*//,/ }}" "$@"
if [[ ! " $* " =~ " --"(tables|scenes|engines|threads|frames|csv|cpu-clock)[\ =] ]]; then  # the whole table
  cp $csv Docs/Data/Performance.csv
  for page in README.md Docs/Performance.md Docs/HowTo/RestingContact.md; do
    python3 Testing/Benchmark/tables.py Docs/Data/Performance.csv $page
  done
fi
echo "figures: $csv"
