#!/bin/bash
# matrix.sh [NAME...]: builds the core with each of the named compilers and options (default: all) and compares its answers
# with Data/Golden.txt. Run from anywhere; the builds stay in build/golden-<name>. Needs clang-14, lld-14, libc++-14-dev,
# libc++abi-14-dev and, for arm64, g++-aarch64-linux-gnu and qemu-user.
set -uo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."

declare -A options=(
  [gcc-O0]="-DCMAKE_CXX_COMPILER=g++ -DCMAKE_CXX_FLAGS_RELEASE=-O0"
  [gcc-O2]="-DCMAKE_CXX_COMPILER=g++ -DCMAKE_CXX_FLAGS_RELEASE=-O2"
  [gcc-O3-lto]="-DCMAKE_CXX_COMPILER=g++ -DCMAKE_CXX_FLAGS_RELEASE=-O3 -DCMAKE_INTERPROCEDURAL_OPTIMIZATION=ON"
  [gcc-scalar]="-DCMAKE_CXX_COMPILER=g++ -DPALPATE_SIMD=OFF"
  [clang-O0]="-DCMAKE_CXX_COMPILER=clang++-14 -DCMAKE_CXX_FLAGS_RELEASE=-O0"
  [clang-O2]="-DCMAKE_CXX_COMPILER=clang++-14 -DCMAKE_CXX_FLAGS_RELEASE=-O2"
  [clang-O3]="-DCMAKE_CXX_COMPILER=clang++-14 -DCMAKE_CXX_FLAGS_RELEASE=-O3"
  [clang-O3-lto]="-DCMAKE_C_COMPILER=clang-14 -DCMAKE_CXX_COMPILER=clang++-14 -DCMAKE_CXX_FLAGS_RELEASE=-O3
    -DCMAKE_INTERPROCEDURAL_OPTIMIZATION=ON -DCMAKE_EXE_LINKER_FLAGS=-fuse-ld=lld-14"
  [clang-libcxx]="-DCMAKE_CXX_COMPILER=clang++-14 -DCMAKE_CXX_FLAGS=-stdlib=libc++"
  [arm64]="-DCMAKE_TOOLCHAIN_FILE=CMake/Arm64.cmake -DCMAKE_CXX_FLAGS_RELEASE=-O1 -DPALPATE_UNITY=ON"
)
(($#)) || set -- $(printf '%s\n' "${!options[@]}" | sort)

# check NAME: builds and runs one configuration.
check() {
  local folder=build/golden-$1 chosen
  read -ra chosen <<<"$(echo ${options[$1]})"
  [[ $1 != arm64 ]] || CMake/arm64.sh build/arm64-packages || return
  cmake -S . -B "$folder" -G Ninja -DCMAKE_BUILD_TYPE=Release -DPALPATE_WITH_VTK=OFF -DPALPATE_WITH_FCL=OFF \
    -DPALPATE_BUILD_EXAMPLES=OFF -DPALPATE_TEST_FOLDERS=Golden -DPALPATE_PRECOMPILED_HEADERS=ON "${chosen[@]}" >/dev/null &&
    cmake --build "$folder" --target Golden >"$folder/log.txt" || { tail -20 "$folder/log.txt"; return 1; }
  ctest --test-dir "$folder" --timeout 7200 --output-on-failure >"$folder/log.txt" || { cat "$folder/log.txt"; return 1; }
}
failed=0
for name in "$@"; do
  [[ -v options[$name] ]] || { echo "matrix.sh: no configuration $name" >&2; exit 1; }
  if check "$name"; then echo "$name: the same hashes"; else echo "$name: FAILED"; failed=1; fi
done
exit $failed
