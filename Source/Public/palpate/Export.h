#pragma once

/// Marks the symbols that the shared library exports. All others are hidden.
#ifndef _WIN32
#define PALPATE_EXPORT __attribute__((visibility("default")))
#elif defined(PALPATE_BUILDING_DLL)
#define PALPATE_EXPORT __declspec(dllexport)
#else
#define PALPATE_EXPORT
#endif
