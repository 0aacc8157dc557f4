#pragma once

#include <palpate/OctreeBasedCD.h>

#include <functional>
#include <string>

namespace palpate::vtk {

/// The result of a pair; empty before the first detection.
const CollisionData& answerOf(const OctreeBasedCD&, GeometryId a, GeometryId b);

/// Lines of text about the last frame: contacts, times and validity. framesPerSecond: 0 is not
/// shown.
std::string panelText(const OctreeBasedCD&, const std::function<std::string(GeometryId)>& nameOf,
                      int frame, double framesPerSecond);

}  // namespace palpate::vtk
