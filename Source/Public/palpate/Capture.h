#pragma once

#include <palpate/Audit.h>
#include <palpate/CollisionProblem.h>
#include <palpate/Export.h>
#include <palpate/OctreeBasedCD.h>

#include <filesystem>

namespace palpate {

/// Writes the problem of the last frame, exactly, as text. Call it before positions change.
///
/// Errors   ErrorCode::File if it cannot be written; there is then no part of it, and a file that
///          was there before is unharmed.
PALPATE_EXPORT void capture(const OctreeBasedCD&, const std::filesystem::path&);

/// The same of the pair of an audit's failure alone: a file that replays it.
PALPATE_EXPORT void capture(const OctreeBasedCD&, const AuditFailure&,
                            const std::filesystem::path&);

PALPATE_EXPORT void writeCapture(const CollisionProblem&, const std::filesystem::path&);

/// Errors   ErrorCode::File, with the file's name and what is wrong with it: missing, not a
///          capture, of another version, cut off, or with what an OctreeBasedCD would refuse.
PALPATE_EXPORT CollisionProblem readCapture(const std::filesystem::path&);

/// Ready for detectCollision(): geometry i is GeometryId{i}. What an octree owes to earlier frames
/// is not part of a problem: it is built anew.
PALPATE_EXPORT OctreeBasedCD setUp(const CollisionProblem&);

}  // namespace palpate
