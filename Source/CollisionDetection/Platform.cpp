// Part of <palpate/Executor.h>: simdPath().
#include <palpate/Executor.h>

#include "Core/SimdPath.h"

namespace palpate {

std::string simdPath() { return currentSimdPath(); }

}  // namespace palpate
