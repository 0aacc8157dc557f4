#pragma once

#include <palpate/Audit.h>
#include <palpate/CollisionProblem.h>
#include <palpate/Export.h>
#include <palpate/OctreeBasedCD.h>

#include <filesystem>

namespace palpate {

// A capture is a text file with a CollisionProblem. It replays a frame exactly: every double keeps
// its bits.

/// Writes OctreeBasedCD::problem() to a file. Call it after a frame and before positions change:
/// the capture then replays that frame.
///
/// Errors   File if it cannot be written; an existing file is then unchanged. NonFinitePosition for
///          a body that is placed beyond kLargestMeasure: captures hold positions in the world.
PALPATE_EXPORT void capture(const OctreeBasedCD&, const std::filesystem::path&);

/// The same for the pair of an audit's failure alone. Call it before positions change, too.
PALPATE_EXPORT void capture(const OctreeBasedCD&, const AuditFailure&,
                            const std::filesystem::path&);

/// Writes a problem to a file, with the errors of capture() and setUp().
PALPATE_EXPORT void writeCapture(const CollisionProblem&, const std::filesystem::path&);

/// Reads a capture.
///
/// Errors   File, with the file's name and the reason: the file is missing, is no capture, has an
///          unknown version, is truncated, or has content that an OctreeBasedCD refuses.
PALPATE_EXPORT CollisionProblem readCapture(const std::filesystem::path&);

/// Makes an OctreeBasedCD from a problem, ready for detectCollision(). Geometry i has the id
/// GeometryId{i}. Its octrees are built anew; contacts do not depend on their history.
///
/// Errors   those of the functions of OctreeBasedCD that add geometries and pairs.
PALPATE_EXPORT OctreeBasedCD setUp(const CollisionProblem&);

}  // namespace palpate
