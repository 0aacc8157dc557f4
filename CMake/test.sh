#!/bin/bash
# From nothing to tested: packages, every configuration that CI builds, their tests. The release
# configuration's tests run last, so that ctest's summary of them is the last thing printed. Fails if
# any configuration did.
set -uo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

# No further configuration is started after this many seconds, so that a clean run fits 25 minutes
# on two cores.
readonly kLatestStart=840
failed=0

# stage NAME COMMAND...: runs it and prints how long it took.
stage() {
  local name=$1 start=$SECONDS result=done
  shift
  echo "--- $name"
  "$@" || { result=FAILED; failed=1; }
  echo "--- $name: $result after $((SECONDS - start)) s"
  [[ $result == done ]]
}
build() { stage "$1: build" cmake --build --preset "$1" --parallel "$(nproc)"; }

# configuration PRESET [-DOPTION...]: configured, built and tested.
configuration() {
  local preset=$1
  if ((SECONDS > kLatestStart)); then
    echo "--- $preset: skipped, $SECONDS s have passed"
    return
  fi
  stage "$preset: configure" cmake --preset "$@" && build "$preset" &&
    stage "$preset: test" ctest --preset "$preset"
}

stage packages CMake/packages.sh build test || exit 1
stage "release: configure" cmake --preset release && build release || exit 1
# The core as a static library, without SIMD, VTK and FCL.
configuration scalar -DBUILD_SHARED_LIBS=OFF
configuration asan-ubsan
((failed)) && echo "--- a configuration FAILED, see above"
echo "--- release: test, after $SECONDS s"
ctest --preset release || failed=1
exit $failed
