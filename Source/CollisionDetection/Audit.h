#pragma once

#include <palpate/Audit.h>
#include <palpate/Settings.h>

#include "CollisionDetection/PairTable.h"
#include "NarrowPhase/NarrowPhase.h"

#include <cstdint>
#include <vector>

namespace palpate {

/// At most settings.features of all that the pair's method tests, each as likely as any other. The
/// same for the same seed, frame and pair.
FeatureLists drawFeatures(const MeshPair&, const CollisionPair&, const AuditSettings&,
                          std::uint64_t frame);

/// Appends every contact that brute force finds from a drawn sample of features and `data` lacks.
void audit(const MeshPair&, const CollisionPair&, const CollisionData& data, const AuditSettings&,
           std::uint64_t frame, std::vector<AuditFailure>& out);

}  // namespace palpate
