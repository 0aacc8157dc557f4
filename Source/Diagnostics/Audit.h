#pragma once

#include <palpate/Audit.h>
#include <palpate/CollisionProblem.h>
#include <palpate/OctreeBasedCD.h>
#include <palpate/Settings.h>

#include "Diagnostics/ContactsByBruteForce.h"
#include "NarrowPhase/NarrowPhase.h"

#include <cstdint>
#include <span>
#include <vector>

namespace palpate {

/// At most settings.features of all that the pair's method tests, each as likely as any other. The
/// same for the same seed, frame and pair.
FeatureLists drawFeatures(const MeshPair&, const CollisionPair&, const AuditSettings&,
                          std::uint64_t frame);

/// Appends every contact that a drawn sample of features should have by brute force and has not in
/// `data`, or the other way round. Of Method::Auto only what is missing, with earliestTimeOnly
/// impacts before the one known.
void audit(const MeshPair&, const CollisionPair&, const CollisionData& data, const AuditSettings&,
           std::uint64_t frame, std::vector<AuditFailure>& out);

/// One pair of the problem alone.
CollisionProblem pairAlone(const CollisionProblem&, GeometryId a, GeometryId b);

}  // namespace palpate
