#include <palpate/Platform.h>

#include "Core/SimdPath.h"

namespace palpate {

std::string simdPath() { return currentSimdPath(); }

}  // namespace palpate
