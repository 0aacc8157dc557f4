#pragma once

#include <palpate/Export.h>

#include <string>

namespace palpate {

/// The instruction set that this process's frames run on, chosen at run time: "AVX3" (AVX-512),
/// "AVX2", "SSE4" or "Scalar". Results do not depend on it.
PALPATE_EXPORT std::string simdPath();

}  // namespace palpate
