#!/bin/bash
# CMake/windows.sh: builds the library for 64-bit Windows by MinGW-w64 and runs the unit tests and golden hashes under Wine.
# Then it builds Palpate.dll, with no library of the compiler, into build/windows-dll, and runs the C example on it. Needs
# root or sudo for the packages and for what Debian has as source only: GMP, Highway and GoogleTest are compiled for
# Windows from there.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

CMake/packages.sh build test windows
root=$PWD/build/windows-packages
cross=x86_64-w64-mingw32

# packages: puts the libraries for Windows into $root.
packages() {
  local work=build/windows-sources
  rm -rf "$root" $work
  mkdir -p "$root/lib/pkgconfig" "$root/include" $work/lists/partial
  cd $work
  site=$(apt-get indextargets --format '$(SITE)' 'Created-By: Packages' 'Codename: bookworm' | head -n 1)
  echo "deb-src $site bookworm main" >sources.list
  local apt=(apt-get -qq -o APT::Sandbox::User= -o Dir::Etc::SourceList="$PWD/sources.list" -o Dir::Etc::SourceParts=-
    -o Dir::State::Lists="$PWD/lists")
  "${apt[@]}" update
  "${apt[@]}" source --download-only gmp highway
  for archive in *.orig.tar.*; do tar xf "$archive"; done
  # Debian leaves GMP's manual out.
  (cd gmp-*/ && mkdir -p doc && echo "all:" >doc/Makefile.in &&
    ./configure --host=$cross --disable-shared CC=$cross-gcc-posix &&
    make -j"$(nproc)" SUBDIRS="mpn mpz mpq mpf printf scanf rand" &&
    cp .libs/libgmp.a "$root/lib" && cp gmp.h gmpxx.h "$root/include") >gmp.log 2>&1 || { tail gmp.log; exit 1; }
  (
    cd highway-*/
    for file in aligned_allocator targets per_target print; do
      $cross-g++-posix -O2 -std=c++17 -I. -DHWY_STATIC_DEFINE -c hwy/$file.cc -o $file.o
    done
    $cross-ar rcs "$root/lib/libhwy.a" ./*.o
    mkdir "$root/include/hwy"
    cp -r hwy/*.h hwy/ops "$root/include/hwy"
  )
  for name in gmp hwy; do
    local pc=$name flags=
    [[ $name == hwy ]] && pc=libhwy flags=-DHWY_STATIC_DEFINE
    printf '%s\n' "prefix=$root" "Name: $name" "Description: for Windows" "Version: 0" "Libs: -L\${prefix}/lib -l$name" \
      "Cflags: -I\${prefix}/include $flags" >"$root/lib/pkgconfig/$pc.pc"
  done
  apt-get -qq download libeigen3-dev libcli11-dev nlohmann-json3-dev
  for package in *.deb; do dpkg -x "$package" headers; done
  cp -r headers/usr/include headers/usr/share "$root"
  cmake -S /usr/src/googletest -B gtest -G Ninja -DCMAKE_TOOLCHAIN_FILE="$OLDPWD/CMake/Windows.cmake" -DCMAKE_BUILD_TYPE=Release \
    -DBUILD_GMOCK=OFF -DCMAKE_INSTALL_PREFIX="$root" >gtest.log
  cmake --build gtest --target install >>gtest.log
  cd "$OLDPWD"
  touch "$root/complete"
}
if [[ ! -e $root/complete ]]; then packages; fi

export WINEPREFIX=$PWD/build/wine WINEDEBUG=-all
mkdir -p "$WINEPREFIX"
# Started here, Wine's server and services hold no pipe of a test, which would never end.
/usr/lib/wine/wineserver64 -p
/usr/lib/wine/wine64 wineboot --init >/dev/null 2>&1
trap '/usr/lib/wine/wineserver64 -k' EXIT
cmake --preset windows
cmake --build --preset windows --parallel
ctest --preset windows --parallel "$(nproc)"

folder=build/windows-dll
cmake --preset windows -B $folder -DBUILD_SHARED_LIBS=ON -DPALPATE_BUILD_TESTING=OFF -DCMAKE_INSTALL_PREFIX="$PWD/$folder/installed"
cmake --build $folder --parallel
cmake --install $folder >/dev/null
cp Examples/HelloCollisionC/HelloCollision.c $folder
(
  cd $folder
  $cross-gcc-posix -std=c99 -I installed/include HelloCollision.c installed/lib/libPalpate.dll.a -o installed/bin/HelloCollision.exe
  /usr/lib/wine/wine64 installed/bin/HelloCollision.exe
)
echo "windows.sh: tests passed under Wine; $folder/installed has Palpate.dll"
