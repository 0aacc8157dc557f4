#pragma once

/// Marks the symbols that the shared library exports. All others are hidden.
#define PALPATE_EXPORT __attribute__((visibility("default")))
