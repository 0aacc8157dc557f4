# Compile options shared by every target of the tree.
add_library(PalpateOptions INTERFACE)
# No fused multiply-add: a contracted a*b+c rounds once instead of twice, and results would then
# depend on the instruction set that run-time dispatch happens to choose.
target_compile_options(PalpateOptions INTERFACE -ffp-contract=off -Wall -Wextra -Wshadow -Wnon-virtual-dtor)
# On 64-bit ARM Eigen would multiply and add with one rounding. Without packets at all it would add in another order.
if(CMAKE_SYSTEM_PROCESSOR MATCHES "aarch64|arm64")
  target_compile_options(PalpateOptions INTERFACE -U__ARM_FEATURE_FMA)
endif()
if(PALPATE_SANITIZE)
  target_compile_options(PalpateOptions INTERFACE -fsanitize=${PALPATE_SANITIZE} -fno-omit-frame-pointer
                                                  -fno-sanitize-recover=all)
  target_link_options(PalpateOptions INTERFACE -fsanitize=${PALPATE_SANITIZE})
  if(CMAKE_CXX_COMPILER_ID STREQUAL Clang)
    # With this check clang 14 takes up to six times as long for SIMD code.
    target_compile_options(PalpateOptions INTERFACE -fno-sanitize=pointer-overflow)
  endif()
  if(CMAKE_CXX_COMPILER_ID STREQUAL Clang AND PALPATE_SANITIZE MATCHES thread)
    # Linked as C++, clang adds a part of ThreadSanitizer's runtime that defines `operator new`, which tests replace.
    target_link_options(PalpateOptions INTERFACE --driver-mode=gcc)
    target_link_libraries(PalpateOptions INTERFACE stdc++ m)
  endif()
endif()

# A shared library of ours exports what is ours.
function(palpate_export_own_symbols target)
  if(BUILD_SHARED_LIBS)
    target_link_options(${target} PRIVATE LINKER:--version-script=${PROJECT_SOURCE_DIR}/CMake/exports.map)
    set_property(TARGET ${target} APPEND PROPERTY LINK_DEPENDS ${PROJECT_SOURCE_DIR}/CMake/exports.map)
  endif()
endfunction()

# palpate_precompile_headers(TARGET HEADER...): TARGET is compiled with these headers precompiled, if the build asks for it.
# The scalar build does not ask: it shows that every file includes what it uses.
function(palpate_precompile_headers target)
  if(PALPATE_PRECOMPILED_HEADERS)
    target_precompile_headers(${target} PRIVATE ${ARGN})
  endif()
endfunction()
