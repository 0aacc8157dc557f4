#pragma once

#include "Contact/Contents.h"

namespace palpate {

/// Makes the contents those of a copy, which knows no record. It keeps the offsets of its rows if
/// the step that was detected is not over.
void keepOffsets(CollisionData::Contents&);

}  // namespace palpate
