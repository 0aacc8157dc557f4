# Compile options shared by every target of the tree.
add_library(PalpateOptions INTERFACE)
# No fused multiply-add: a contracted a*b+c rounds once instead of twice, and results would then
# depend on the instruction set that run-time dispatch happens to choose.
if(CMAKE_CXX_COMPILER_ID STREQUAL MSVC)
  message(FATAL_ERROR "Palpate needs 128-bit integers, which MSVC does not have. Use clang-cl or MinGW-w64.")
elseif(MSVC) # clang-cl, with which nothing was compiled yet
  target_compile_options(PalpateOptions INTERFACE /clang:-ffp-contract=off /W4 /EHsc /bigobj)
  target_compile_definitions(PalpateOptions INTERFACE NOMINMAX)
else()
  target_compile_options(PalpateOptions INTERFACE -ffp-contract=off -Wall -Wextra -Wshadow -Wnon-virtual-dtor)
endif()
# g++ collects its garbage from 600 MB on instead of 128 MB: a twelfth less of the compile time of large batches.
if(CMAKE_CXX_COMPILER_ID STREQUAL GNU)
  target_compile_options(PalpateOptions INTERFACE --param=ggc-min-heapsize=600000)
endif()
# On 64-bit ARM Eigen would multiply and add with one rounding. Without packets at all it would add in another order.
if(CMAKE_SYSTEM_PROCESSOR MATCHES "aarch64|arm64")
  target_compile_options(PalpateOptions INTERFACE -U__ARM_FEATURE_FMA)
endif()
if(PALPATE_SIMD_NATIVE)
  # Highway's names of the paths; the scalar one is always there.
  file(STRINGS /proc/cpuinfo flags REGEX "^flags" LIMIT_COUNT 1)
  if(flags MATCHES "avx512f.* avx512dq.* avx512cd.* avx512bw.* avx512vl")
    set(otherPaths "HWY_SSE4 | HWY_AVX2")
  elseif(flags MATCHES " avx2")
    set(otherPaths "HWY_SSE4 | HWY_AVX3")
  else()
    set(otherPaths "HWY_AVX2 | HWY_AVX3")
  endif()
  target_compile_definitions(PalpateOptions INTERFACE "PALPATE_SIMD_PATHS_LEFT_OUT=(${otherPaths})")
endif()
if(WIN32 AND BUILD_SHARED_LIBS)
  target_compile_definitions(PalpateOptions INTERFACE PALPATE_BUILDING_DLL)
endif()
if(PALPATE_SANITIZE)
  target_compile_options(PalpateOptions INTERFACE -fsanitize=${PALPATE_SANITIZE} -fno-omit-frame-pointer
                                                  -fno-sanitize-recover=all)
  target_link_options(PalpateOptions INTERFACE -fsanitize=${PALPATE_SANITIZE})
  if(CMAKE_CXX_COMPILER_ID STREQUAL Clang AND PALPATE_SANITIZE MATCHES undefined)
    # Of tests, the addresses are checked: other checks take a third of their compile time.
    target_compile_options(PalpateOptions INTERFACE
      $<$<BOOL:$<TARGET_PROPERTY:PALPATE_IS_TEST>>:-fno-sanitize=undefined,fuzzer-no-link>)
  endif()
  if(CMAKE_CXX_COMPILER_ID STREQUAL Clang)
    # With the first of these checks clang 14 takes up to six times as long for SIMD code. The others take a quarter of the
    # compile time, and AddressSanitizer finds what they would: it sees each access to memory.
    target_compile_options(PalpateOptions INTERFACE -fno-sanitize=pointer-overflow,null,object-size,vptr)
  endif()
  if(CMAKE_CXX_COMPILER_ID STREQUAL Clang AND PALPATE_SANITIZE MATCHES thread)
    # Linked as C++, clang adds a part of ThreadSanitizer's runtime that defines `operator new`, which tests replace.
    target_link_options(PalpateOptions INTERFACE --driver-mode=gcc)
    target_link_libraries(PalpateOptions INTERFACE stdc++ m)
  endif()
endif()

# palpate_export_own_symbols(TARGET [MAP...]): a shared library of ours exports what is ours, and what the further linker
# scripts of this folder name. On Windows and macOS it exports what PALPATE_EXPORT marks.
function(palpate_export_own_symbols target)
  if(BUILD_SHARED_LIBS AND NOT (WIN32 OR APPLE))
    foreach(map exports.map ${ARGN})
      target_link_options(${target} PRIVATE LINKER:--version-script=${PROJECT_SOURCE_DIR}/CMake/${map})
      set_property(TARGET ${target} APPEND PROPERTY LINK_DEPENDS ${PROJECT_SOURCE_DIR}/CMake/${map})
    endforeach()
  endif()
endfunction()

# palpate_precompile_headers(TARGET HEADER...): TARGET is compiled with these headers precompiled, if the build asks for it.
# That every file includes what it uses, Frame.UnoptimizedBuild shows under `ctest -L long`.
function(palpate_precompile_headers target)
  if(PALPATE_PRECOMPILED_HEADERS)
    target_precompile_headers(${target} PRIVATE ${ARGN})
  endif()
endfunction()

# palpate_compile_quickly(TARGET): for code in which a frame spends little time. Instead of -O3, the default of a release, g++
# takes -O1 and inlines functions, in two thirds of the compile time (Docs/Notes/Build.md). Another level that the build asks
# for stays. A precompiled header gives its level to the files that use it, so that all of a target have one level.
function(palpate_compile_quickly target)
  if(CMAKE_CXX_COMPILER_ID STREQUAL GNU AND CMAKE_CXX_FLAGS_RELEASE MATCHES "-O3")
    set(options -O1 -finline-functions -finline-small-functions -findirect-inlining -fpartial-inlining -fstrict-aliasing)
    target_compile_options(${target} PRIVATE "$<$<CONFIG:Release>:${options}>")
  endif()
endfunction()

# palpate_join_files(TARGET FILE...): TARGET's files of one folder are compiled in batches, if the build asks for it. Files
# with SIMD code include themselves once for each instruction set. Their two batches, of every second folder each, do so
# for all of them, so that Highway is parsed twice for each set.
function(palpate_join_files target)
  if(NOT PALPATE_UNITY)
    return()
  endif()
  set(folders)  # with SIMD code
  set(simd0)
  set(simd1)
  foreach(source IN LISTS ARGN)
    if(NOT source MATCHES "\\.cpp$")
      continue()
    endif()
    get_filename_component(source ${source} ABSOLUTE)
    get_filename_component(folder ${source} DIRECTORY)
    get_filename_component(folder ${folder} NAME)
    file(STRINGS ${source} simd REGEX "HWY_BEFORE_NAMESPACE" LIMIT_COUNT 1)
    if(NOT simd)
      set_source_files_properties(${source} PROPERTIES UNITY_GROUP ${folder})
      continue()
    endif()
    if(NOT folder IN_LIST folders)
      list(APPEND folders ${folder})
    endif()
    list(FIND folders ${folder} place)
    math(EXPR place "${place} % 2")
    list(APPEND simd${place} ${source})
  endforeach()
  foreach(place IN ITEMS 0 1)
    if(NOT simd${place})
      continue()
    endif()
    set(batch ${CMAKE_CURRENT_BINARY_DIR}/Simd/${target}${place}.cpp)
    set(named "#undef HWY_TARGET_INCLUDE\n#define HWY_TARGET_INCLUDE \"${batch}\"\n")
    set(content "${named}#include \"Core/Simd.h\"\n")
    foreach(source IN LISTS simd${place})
      string(APPEND content "#include \"${source}\"\n")
    endforeach()
    # Each file has named itself. The next instruction set includes the batch again.
    file(CONFIGURE OUTPUT ${batch} CONTENT "${content}${named}" @ONLY NEWLINE_STYLE UNIX)
    set_source_files_properties(${simd${place}} PROPERTIES HEADER_FILE_ONLY ON)
    target_sources(${target} PRIVATE ${batch})
  endforeach()
  set_target_properties(${target} PROPERTIES UNITY_BUILD ON UNITY_BUILD_MODE GROUP)
  # g++ bounds the growth of a file by inlining. A batch may grow as much as its files do.
  target_compile_options(${target} PRIVATE $<$<CXX_COMPILER_ID:GNU>:--param=large-unit-insns=100000>)
endfunction()
