#pragma once

#include <palpate/SpatialQueries.h>

#include "Queries/BodyOverlap.h"
#include "Queries/BodyPair.h"
#include "Queries/InsideRegions.h"
#include "Queries/ShortestTranslation.h"
#include "Queries/TranslationSweep.h"
#include "Shapes/Polytope.h"

#include <Eigen/Core>

#include <cstddef>
#include <cstdint>
#include <vector>

namespace palpate {

struct PenetrationScratch {
  /// A direction to try.
  struct Seed {
    Eigen::Vector3d direction;
    std::size_t place;  ///< in the order in which directions were found
    double bound = 0;   ///< L: no translation along it that separates is shorter
  };

  BodyPairScratch pair;
  OverlapScratch overlap;
  SweepScratch sweep;
  InsideRegionsScratch regions;
  Polytope difference;
  ShortestTranslation shortest;
  CountedVector<BodyPair::IntersectingTriangles> intersecting;  ///< where a is not moved
  CountedVector<std::uint32_t> insideA, insideB;  ///< some vertices inside the other body
  CountedVector<Seed> seeds;
};

/// How far a search goes on after it has found a translation that separates.
struct PenetrationEffort {
  int translations;      ///< so many directions start a descent; more if none of them separates
  std::size_t inside;    ///< vertices of a body that are tested
  bool aroundTheSphere;  ///< whether directions around the sphere are tried
  Moved moved;
};
/// For the query.
constexpr PenetrationEffort kThorough{24, 1024, true, Moved::Body};
/// For contacts of bodies: a direction that leaves is enough. They are those of the positions.
constexpr PenetrationEffort kQuick{2, 64, false, Moved::Positions};

/// The answer for bodies that do not overlap.
Penetration apart(GeometryId a, GeometryId b);

/// The translation of a that separates two closed meshes (SpatialQueries::penetration()).
///
/// Method   The directions are those that separate the convex hulls, normals of faces that meet or
///          are inside, and a set around the sphere. Rays from inside vertices bound the depth of
///          each from below. Along a direction TranslationSweep proposes where surfaces no longer
///          cross, and OverlapTest decides whether the bodies are apart there. From the best
///          directions the search goes on to the shortest translation that satisfies all contacts
///          at which translations ended. If nothing separates the bodies, a leaves the hull of b.
/// Cost     linear in the triangles: all sweeps together have kOperationsPerTriangle for each, or
///          four times as many until something separates the bodies, and then a quarter more for
///          shorter translations. Each test costs what it finds.
Penetration penetrationOf(const Body& a, const Body& b, Engine, PenetrationScratch&,
                          const PenetrationEffort& = kThorough);
/// The same of bodies with triangles. The pair must use scratch.pair and effort.moved.
Penetration penetrationOf(const BodyPair&, PenetrationScratch&, const PenetrationEffort&);

}  // namespace palpate
