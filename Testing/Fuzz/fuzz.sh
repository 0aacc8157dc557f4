#!/bin/bash
# Testing/Fuzz/fuzz.sh [SECONDS] [TARGET...]: fuzzes each target (default: all) for so many seconds (default: 60) on all
# cores, one target after another, starting with the kept corpus in Data/Fuzz. Prints executions, coverage and findings of
# each. Inputs with new coverage are kept in build/fuzz/corpus for the next run. A finding is stored in Data/Fuzz as
# TARGET/finding-..., where tests replay it. Exit code 1: there are findings. Build the preset `fuzz` first.
# With PALPATE_FUZZ_JOBS=1 and PALPATE_FUZZ_SEED=N, a run repeats another one with the same corpus.
set -uo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
seconds=${1:-60}
shift
targets=("$@")
((${#targets[@]})) || targets=($(sed -nE 's/.*Target\{"([A-Za-z]+)".*/\1/p' Testing/Fuzz/Targets.h))
build=${PALPATE_FUZZ_BUILD:-build/fuzz}
jobs=${PALPATE_FUZZ_JOBS:-$(nproc)}
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
export TMPDIR=$scratch
# Short call stacks of allocations, and few freed bytes kept, cost less time.
export ASAN_OPTIONS=malloc_context_size=4:quarantine_size_mb=16

# Bytes of an input at most: what a target reads, or enough of a file.
mostBytes() {
  case $1 in
    Distance | Intersection | TimeOfImpact) echo 256 ;;
    History) echo 1500 ;;
    *) echo 16384 ;;
  esac
}
# Seconds that an input may take: rational arithmetic, the truth of the exact functions, is slow for huge exponents.
mostSeconds() {
  case $1 in
    Distance | Intersection | TimeOfImpact) echo 120 ;;
    *) echo 10 ;;
  esac
}
# Executions of all processes, and the largest coverage of one.
executions() { cat "$@" | sed -nE 's/^stat::number_of_executed_units: +//p' | awk '{all += $1} END {print all + 0}'; }
coverage() { grep -ohE 'cov: [0-9]+' "$@" | awk '$2 > most {most = $2} END {print most + 0}'; }

findings=0
printf '%-14s %12s %9s %9s\n' target executions coverage findings
for target in "${targets[@]}"; do
  program=$build/Testing/Fuzz/Fuzz$target
  corpus=$build/corpus/$target
  mkdir -p "$corpus" "$scratch/$target"
  for ((job = 0; job < jobs; ++job)); do
    "$program" "$corpus" "Data/Fuzz/$target" -seed="${PALPATE_FUZZ_SEED:-0}" -max_total_time="$seconds" \
      -max_len="$(mostBytes "$target")" -timeout="$(mostSeconds "$target")" -entropic=0 \
      -rss_limit_mb=2048 -malloc_limit_mb=512 -print_final_stats=1 -artifact_prefix="$scratch/$target/" \
      >"$scratch/$target.$job.log" 2>&1 &
  done
  failed=0
  for job in $(jobs -p); do wait "$job" || ((++failed)); done
  for file in "$scratch/$target"/*; do
    [[ -f $file ]] && cp "$file" "Data/Fuzz/$target/finding-$(basename "$file" | cut -c1-20)"
  done
  printf '%-14s %12s %9s %9s\n' "$target" "$(executions "$scratch/$target".*.log)" "$(coverage "$scratch/$target".*.log)" "$failed"
  ((failed)) && { findings=1; tail -n 60 "$scratch/$target".*.log; }
done
exit $findings
