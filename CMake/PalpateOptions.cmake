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
