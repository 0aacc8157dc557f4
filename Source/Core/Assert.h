#pragma once

/// Internal invariants, never on user input (that throws). Checked in all builds but Release, where
/// they cost nothing.
#if defined(PALPATE_ASSERTIONS) || defined(PALPATE_VALIDATE) || !defined(NDEBUG)
#include <cstdio>
#include <cstdlib>
#define PALPATE_ASSERT(condition)                                                        \
  do {                                                                                   \
    if (!(condition)) {                                                                  \
      std::fprintf(stderr, "%s:%d: %s does not hold\n", __FILE__, __LINE__, #condition); \
      std::abort();                                                                      \
    }                                                                                    \
  } while (false)
#else
#define PALPATE_ASSERT(condition) static_cast<void>(0)
#endif
