// Links the installed adapter, with iMSTK and the library behind it.
#include <palpate/imstk/PalpateScene.h>

#include <cstring>

static_assert(__cplusplus < 202002L, "iMSTK refuses C++20.");

int main() { return std::strcmp(palpate::toString(palpate::PalpateMethod::Auto), "Auto"); }
