#pragma once

#include <palpate/Settings.h>

namespace palpate {

/// Returns the settings, or throws InvalidSettings with the fault.
const Settings& checked(const Settings&);

}  // namespace palpate
