#!/bin/bash
# CMake/test.sh: from nothing to tested on Debian 12: packages, the release library with its tests, the Python package, a
# separate project. ctest's summary comes last.
# CMake/test.sh --all: what CI runs: also examples, documentation, conventions, scalar code, sanitizers, 64-bit ARM.
# Every stage runs, also after another one failed. The script fails if any stage failed or did not run. The release tests
# run last, so that ctest's summary of them is the last thing printed; after a failure, what failed follows it.
set -uo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

all=0
case $*:$# in
  :0) ;;
  --all:1) all=1 ;;
  *) sed -n '2,4s/^# //p' "${BASH_SOURCE[0]}" >&2; exit 2 ;;
esac
jobs=$(nproc)
tests=$((jobs + 1))  # some wait for a display or a browser
report=()
failed=0

# CPU time of all finished child processes, in hundredths of a second.
cpuTime() {
  local fields
  read -ra fields </proc/$$/stat
  echo $(((fields[15] + fields[16]) * 100 / $(getconf CLK_TCK)))
}
# record NAME RESULT SECONDS CPU: adds a line to the table of stages.
record() { report+=("$(printf '%-22s %-7s %7s %9s' "$@")"); }
# stage NAME COMMAND...: runs the command, prints how long it took and records the result.
stage() {
  local name=$1 start=$SECONDS cpu result=done
  cpu=$(cpuTime)
  shift
  echo "--- $name"
  "$@" || { result=FAILED; failed=1; }
  cpu=$((($(cpuTime) - cpu) / 100))
  echo "--- $name: $result after $((SECONDS - start)) s, $cpu s of CPU time"
  record "$name" "$result" $((SECONDS - start)) $cpu
  [[ $result == done ]]
}
notRun() {
  echo "--- $1: NOT RUN"
  record "$1" "NOT RUN" - -
  failed=1
}

# build PRESET [-DOPTION...]: configures and builds. A build goes on after an error, so that all errors are shown.
build() {
  local preset=$1
  if stage "$preset: configure" cmake --preset "$@"; then
    stage "$preset: build" cmake --build --preset "$preset" --parallel "$jobs" -- -k 0
    return 0
  fi
  notRun "$preset: build"
  return 1
}
# configuration PRESET [-DOPTION...]: configures, builds and tests. What a failed build left is tested, too.
configuration() {
  local preset=$1 start=()
  [[ $preset == *san* ]] && start=("${fixedAddresses[@]}")
  if build "$@"; then
    stage "$preset: test" "${start[@]}" ctest --preset "$preset" --parallel "$tests"
  else
    notRun "$preset: test"
  fi
}

# Sanitizers need memory at certain addresses, which some kernels' address space randomization takes away. Some
# containers do not allow to switch it off; they run without.
fixedAddresses=()
setarch --addr-no-randomize true 2>/dev/null && fixedAddresses=(setarch --addr-no-randomize)

if ((all)); then
  echo "Everything that CI runs comes: one hour to one and a half on two cores. Each stage says when it begins and how long it took."
  sets=(build python test matrix docs)
else
  echo "Packages, the release library with its tests, and their run come: 12 to 15 minutes on two idle cores."
  sets=(build python test)
fi
# On a new machine the packages are installed while the library is built.
if [[ ! -e build/release ]] && CMake/packages.sh --missing "${sets[@]}"; then
  stage "packages: compiler" CMake/packages.sh core || exit 1
  CMake/packages.sh "${sets[@]}" &
  stage "library: configure" cmake --preset release -DPALPATE_WITH_{VTK,FCL,PYTHON}=OFF -DPALPATE_BUILD_{TESTING,EXAMPLES}=OFF &&
    stage "library: build" cmake --build --preset release --parallel "$jobs" -- -k 0
  wait || true
fi
stage packages CMake/packages.sh "${sets[@]}" || exit 1
# Without --all: the tests of modules and packages. `cmake --preset release` alone makes this build complete again.
modules=(-DPALPATE_BUILD_EXAMPLES=OFF "-DPALPATE_TEST_FOLDERS=C;Consumer;Exact;Fcl;Frame;Golden;Python;Regression;Unit;Vtk")
tested=modules
((all)) && modules=() tested=release
build release -UPALPATE_WITH_{VTK,FCL,PYTHON,SIMPLIFY} -UPALPATE_BUILD_TESTING "${modules[@]}"
if ((all)); then
  # The core as a static library, without SIMD, VTK and FCL, with oneTBB's threads.
  configuration scalar -DBUILD_SHARED_LIBS=OFF
  # Compiled by clang, with the fuzz targets, and of the SIMD paths the one of this machine.
  configuration asan-ubsan
  # Without SIMD: the scalar code of the modules with threads.
  configuration tsan
  # Hashes of answers on 64-bit ARM, in the emulator.
  stage "arm64: golden hashes" Testing/Golden/matrix.sh arm64
fi

table() { printf '%-22s %-7s %7s %9s\n' stage result seconds "CPU time"; printf '%s\n' "${report[@]}"; }
table
echo "--- release: test, after $SECONDS s"
ctest --preset "$tested" --parallel "$tests" || failed=1
((failed)) || exit 0

# What failed, last, as logs are read from their end.
echo "--- FAILED"
table
for log in build/*/Testing/Temporary/LastTestsFailed.log; do
  [[ -s $log ]] && echo "$log:" && cat "$log"
done
cat build/*/Testing/Temporary/LastTest.log |
  grep -E -A 8 ': Failure$|ERROR: |runtime error: |WARNING: ThreadSanitizer|: FAILED$' | head -n 100 | cut -c 1-300
exit 1
