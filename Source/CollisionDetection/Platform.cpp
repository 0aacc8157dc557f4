#include <palpate/Executor.h>

#include "Core/SimdPath.h"

namespace palpate {

std::string simdPath() { return currentSimdPath(); }

}  // namespace palpate
