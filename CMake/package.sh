#!/bin/bash
# CMake/package.sh: builds the Debian packages into build/package and checks them with lintian. With --try it also
# installs them into a bare Debian 12, as root, and uses each there; it downloads that system from the mirror of apt.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
CMake/packages.sh build python package
folder=build/package
cmake -S . -B $folder -G Ninja -DCMAKE_BUILD_TYPE=Release -DCMAKE_INSTALL_PREFIX=/usr \
  -DCMAKE_INSTALL_LIBDIR="lib/$(dpkg-architecture -qDEB_HOST_MULTIARCH)" -DCMAKE_SKIP_RPATH=ON -DPALPATE_PACKAGES=ON \
  -DPALPATE_BUILD_TESTING=OFF -DPALPATE_WITH_FCL=OFF -DPALPATE_PRECOMPILED_HEADERS=ON -DPALPATE_UNITY=ON \
  -DCMAKE_SHARED_LINKER_FLAGS=-Wl,-z,relro,-z,now -DCMAKE_EXE_LINKER_FLAGS="-s -pie -Wl,-z,relro,-z,now"
cmake --build $folder --parallel
rm -f $folder/*.deb
(cd $folder && cpack -G DEB)
lintian --fail-on error --tag-display-limit 0 $folder/*.deb
[[ ${1:-} == --try ]] && Testing/Packages/try.sh $folder/*.deb
ls -l $folder/*.deb
