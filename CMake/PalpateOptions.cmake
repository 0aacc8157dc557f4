# Compile options shared by every target of the tree.
add_library(PalpateOptions INTERFACE)
# No fused multiply-add: a contracted a*b+c rounds once instead of twice, and results would then
# depend on the instruction set that run-time dispatch happens to choose.
target_compile_options(PalpateOptions INTERFACE -ffp-contract=off -Wall -Wextra -Wshadow -Wnon-virtual-dtor)
if(PALPATE_SANITIZE)
  target_compile_options(PalpateOptions INTERFACE -fsanitize=${PALPATE_SANITIZE} -fno-omit-frame-pointer
                                                  -fno-sanitize-recover=all)
  target_link_options(PalpateOptions INTERFACE -fsanitize=${PALPATE_SANITIZE})
endif()

# A shared library of ours exports what is ours.
function(palpate_export_own_symbols target)
  if(BUILD_SHARED_LIBS)
    target_link_options(${target} PRIVATE LINKER:--version-script=${PROJECT_SOURCE_DIR}/CMake/exports.map)
    set_property(TARGET ${target} APPEND PROPERTY LINK_DEPENDS ${PROJECT_SOURCE_DIR}/CMake/exports.map)
  endif()
endfunction()

# palpate_precompile_headers(TARGET HEADER...): TARGET is compiled with these headers precompiled, if the build asks for it.
# The release build does not ask: it shows that every file includes what it uses.
function(palpate_precompile_headers target)
  if(PALPATE_PRECOMPILED_HEADERS)
    target_precompile_headers(${target} PRIVATE ${ARGN})
  endif()
endfunction()
