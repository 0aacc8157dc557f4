#!/bin/bash
# CMake/simulators.sh: tests the adapter for iMSTK with iMSTK 7.0: packages, iMSTK, the adapter and Testing/Imstk.
# It builds the part of iMSTK that the tests need, from ../shared/imstk or the folder IMSTK_KIT, into build/imstk. With
# iMSTK_DIR it takes an installation instead. The preset release, into which it builds, keeps PALPATE_WITH_IMSTK. Scenes of
# hundreds of steps take some minutes more: ctest --test-dir build/release -L long -R Imstk.Trials
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

kit=${IMSTK_KIT:-../shared/imstk}
if [[ -z ${iMSTK_DIR-} && ! -f $kit/CMakeLists.txt ]]; then
  echo "simulators: nothing ran: $kit has no sources of iMSTK; name them by IMSTK_KIT, or an installation by iMSTK_DIR" >&2
  exit 1
fi
CMake/packages.sh build test
if [[ -n ${iMSTK_DIR-} ]]; then
  options=(-DiMSTK_DIR="$iMSTK_DIR")
else
  kit=$(realpath "$kit")
  echo "--- iMSTK: about 7 minutes of processor time, once"
  cmake -G Ninja -S "$kit" -B build/imstk
  cmake --build build/imstk --parallel "$(nproc)"
  options=(-DiMSTK_DIR="$kit/cmake" -DIMSTK_KIT_BUILD="$PWD/build/imstk")
fi
cmake --preset release -DPALPATE_WITH_IMSTK=ON "${options[@]}"
cmake --build --preset release --parallel "$(nproc)" --target Imstk ImstkByHand palpate_imstk_trials
ctest --test-dir build/release -L '^Imstk$' --output-on-failure
