# Cross-compiles for 64-bit Windows with Debian's MinGW-w64. CMake/windows.sh puts the libraries for it into
# PALPATE_WINDOWS_ROOT. Tests run under Wine.
set(CMAKE_SYSTEM_NAME Windows)
set(CMAKE_SYSTEM_PROCESSOR AMD64)
set(CMAKE_C_COMPILER x86_64-w64-mingw32-gcc-posix)
set(CMAKE_CXX_COMPILER x86_64-w64-mingw32-g++-posix)
set(PALPATE_WINDOWS_ROOT ${CMAKE_CURRENT_LIST_DIR}/../build/windows-packages CACHE PATH "Libraries for Windows")
set(CMAKE_FIND_ROOT_PATH ${PALPATE_WINDOWS_ROOT} /usr/x86_64-w64-mingw32)
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_INCLUDE ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_PACKAGE ONLY)
set(ENV{PKG_CONFIG_LIBDIR} ${PALPATE_WINDOWS_ROOT}/lib/pkgconfig)
set(CMAKE_CROSSCOMPILING_EMULATOR /usr/lib/wine/wine64)
# Wine, and users, need no library of the compiler.
set(CMAKE_EXE_LINKER_FLAGS_INIT -static)
set(CMAKE_SHARED_LINKER_FLAGS_INIT -static)
# g++ does not align the stack to vectors of 32 bytes there, and then moves them as if it did (GCC bug 54412).
set(CMAKE_CXX_FLAGS_INIT -Wa,-muse-unaligned-vector-move)
