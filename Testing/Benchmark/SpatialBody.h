#pragma once

#include "Common/RandomMeshes.h"
#include "SpatialEngine.h"

namespace palpate::benchmark {

/// Where the points of a row's queries are.
enum class Place {
  Near,      ///< within a mean edge of the surface
  Tenth,     ///< within a tenth of the diagonal of the surface
  Anywhere,  ///< in twice the box
  InBox,
  Rays,     ///< from points in twice the box to points in the box
  Raster,   ///< from a focus: part of an X-ray image whose pixels are 1/512 of the diagonal
  Fan,      ///< from points on a line: part of ultrasound images of 256 rays over 60 degrees
  Surface,  ///< on the surface, turned at random
};

/// A row of the table, for three sizes. In microseconds a query on the machine of the targets: the
/// target, and the fastest library there. 0: there is no target.
struct SpatialRow {
  const char* name;
  SpatialQuery query;
  Place place;
  std::array<std::size_t, 3> cases;
  std::array<double, 3> target, fastest;
  bool isBatch = false;  ///< asked by SpatialEngine::askTogether()
};

inline constexpr std::size_t kFrames = 4;

/// A closed body with bumps that deforms, or the set of its vertices.
struct SpatialBody {
  std::string name;
  std::size_t size;  ///< 0, 1 or 2
  bool isPointSet;
  std::vector<Triangle> triangles;  ///< {i, i, i} of a point set
  std::vector<std::vector<Eigen::Vector3d>> frames;
  double diagonal, edge;  ///< L
  ShapeSizes sizes;

  std::span<const SpatialRow> rows() const;
};

/// About 10,000, 100,000 or 1,000,000 elements.
SpatialBody makeBody(std::size_t size, bool isPointSet);

std::vector<SpatialCase> makeCases(const SpatialBody&,
                                   const std::vector<Eigen::Vector3d>& positions, Place,
                                   std::size_t count, testing::Random&);

}  // namespace palpate::benchmark
