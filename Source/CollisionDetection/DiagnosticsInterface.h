#pragma once

#include <palpate/Audit.h>
#include <palpate/CollisionProblem.h>
#include <palpate/Settings.h>

#include "CollisionDetection/GeometryTable.h"
#include "CollisionDetection/PairTable.h"
#include "Core/Buffer.h"
#include "NarrowPhase/NarrowPhase.h"

#include <cstdint>
#include <vector>

// What the frame needs of the module Diagnostics, which includes this module and defines these
// functions. Nothing else of Diagnostics is known here.
namespace palpate {

/// All element pairs whose boxes in double, inflated by half the thickness each, overlap; sorted:
/// the reference for the octree's candidate pairs. Self-collision: a < b, sharing no vertex.
void findCandidatesByBruteForce(const MeshPair&, Buffer<ElementPair>& out);

/// What a frame finds for one pair, from every feature against every other. overlaps: what Auto
/// takes from Intersection.
void detectPairByBruteForce(const PairRecord&, ContactBuffers& contacts, ContactBuffers& overlaps);

/// What a detection would be given now.
CollisionProblem problemOf(const Settings&, const GeometryTable&, const PairTable&);

/// The audit of one OctreeBasedCD over its life.
struct AuditRecord {
  std::vector<AuditFailure> failures;  ///< of the last frame
  std::uint64_t frame = 0;             ///< counts detections
  int files = 0;                       ///< written so far
};

/// Compares the answers of a frame with brute force for a sample of features, as the settings ask.
/// A file that cannot be written is named in the failures.
void auditFrame(const Settings&, const GeometryTable&, const PairTable&, AuditRecord&);

}  // namespace palpate
