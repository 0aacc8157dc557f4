#pragma once

#include <palpate/Settings.h>

namespace palpate {

/// The same; throws what is wrong with them.
const Settings& checked(const Settings&);

}  // namespace palpate
