#pragma once

#include <palpate/Export.h>

#include <string>

namespace palpate {

/// The instruction set that the library uses in this process: "AVX-512", "AVX2", "SSE4" or
/// "Scalar". The library selects it at run time. Results do not depend on it.
PALPATE_EXPORT std::string simdPath();

}  // namespace palpate
