#pragma once

#include <palpate/Capture.h>
#include <palpate/Settings.h>

#include "CollisionDetection/GeometryTable.h"
#include "CollisionDetection/PairTable.h"
#include "NarrowPhase/NarrowPhase.h"
#include "Core/Buffer.h"

#include <cstdint>
#include <span>
#include <vector>

// Functions that this module calls and the module Diagnostics defines. Diagnostics includes this
// module; nothing else in this module depends on Diagnostics. Its files Problem.cpp and Audit.cpp
// define them.
namespace palpate {

/// The complete input of a detection at this moment.
CollisionProblem problemOf(const Settings&, const GeometryTable&, const PairTable&);
/// The same of one geometry, without positions and transforms.
CollisionProblem::Geometry problemOf(const Geometry&);

/// The audit of one OctreeBasedCD over its life.
struct AuditRecord {
  std::vector<AuditFailure> failures;  ///< of the last frame
  std::uint64_t frame = 0;             ///< counts detections
  int files = 0;                       ///< written so far
};

/// Compares the results of a frame with brute force for the sample of features that Settings::audit
/// defines. If a file cannot be written, the failures name it.
void auditFrame(const Settings&, const GeometryTable&, const PairTable&, AuditRecord&);

}  // namespace palpate
