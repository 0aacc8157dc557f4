#pragma once

#include <palpate/Types.h>

#include "Bodies/Body.h"
#include "Core/Threads.h"

namespace palpate {

/// Makes a geometry of a mesh that has an inside, with its octree.
///
/// Errors   NonFinitePosition, also for one beyond kLargestMeasure; IndexOutOfRange; TooLarge for
///          more than 2^28 vertices or triangles; NotClosed, also without triangles.
void makeClosedBody(const TriangleMeshView&, const Threads&, Body& out);
/// The same for a mesh that may be open. Throws NotClosed only for one without triangles.
void makeCheckedBody(const TriangleMeshView&, const Threads&, Body& out);

/// Throws InvalidSettings unless a setting is positive and at most kLargestMeasure.
void checkPositive(double length, const char* name);

}  // namespace palpate
