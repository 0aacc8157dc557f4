#pragma once

#include <palpate/DistanceField.h>
#include <palpate/OctreeBasedCD.h>

#include "Common/RandomMeshes.h"
#include "Common/Solids.h"
#include "Common/TestGeometry.h"

#include <Eigen/Geometry>

#include <cmath>
#include <cstdint>
#include <memory>
#include <vector>

namespace palpate::testing {

/// What WholeScene is made of. It belongs to the user, and counts toward no memory limit.
struct WholeSceneInput {
  /// n: quads along each side of the sheet, at least 4.
  explicit WholeSceneInput(std::uint32_t n)
      : organ(sphere(n, 2 * n, {0.5, 0.5, 0.3}, 0.35)),
        floor(sheet(n, 0.1, 0)),
        bone(sphere(n / 2 + 2, n, {0.5, 0.5, 0.0}, 0.3)) {
    Random random(7);
    suture = thread(random, 4 * n, 0.1, 0.01, false);
    drops = particles(random, n * n, 0.01);
    block = cells(static_cast<int>(n / 4), random);
    for (Vector3d& p : block.positions) p = p * (2.0 / n) + Vector3d(0.2, 0.2, 0.2);
    field = std::make_shared<const DistanceField>(DistanceField::build(
        {bone.positions, bone.triangles}, {.errorBound = 0.02, .band = 0.2, .threads = 1}));
  }

  Mesh organ, floor, bone;
  TestGeometry suture, drops;
  Solid block;
  std::shared_ptr<const DistanceField> field;
};

/// Geometries of every type, pairs of every method, and queries. Equal times give equal positions.
class WholeScene {
 public:
  WholeScene(const WholeSceneInput& input, const Settings& settings, bool withProxy = true)
      : detection(settings), m_input(input) {
    organ = detection.addTriangleMesh(input.organ.positions, input.organ.triangles);
    floor = detection.addTriangleMesh(input.floor.positions, input.floor.triangles);
    bone = detection.addTriangleMesh(input.bone.positions, input.bone.triangles);
    suture = input.suture.addTo(detection);
    drops = input.drops.addTo(detection);
    block = detection.addTetrahedralMesh(input.block.positions, input.block.tetrahedra);
    tool = detection.addAnalyticalGeometry(Capsule{{0, 0, 0}, {0, 0, 1}, 0.1});
    hull = detection.addAnalyticalGeometry(ConvexHull{input.block.positions});
    field = detection.addDistanceField(input.field);
    detection.addCollisionPair(organ, floor, {Method::Auto, 0.02});
    detection.addCollisionPair(organ, organ, {Method::Continuous, 0.0});
    detection.addCollisionPair(suture, organ, {Method::Proximity, 0.05});
    detection.addCollisionPair(drops, organ, {Method::Continuous, 0.01});
    detection.addCollisionPair(block, floor, {Method::Intersection});
    detection.addCollisionPair(organ, tool, {Method::Continuous, 0.0});
    detection.addCollisionPair(tool, hull, {Method::Proximity, 1.0});
    detection.addCollisionPair(organ, field, {Method::DistanceField, 0.05});
    PairSettings proxy{Method::Proxy, 0.05};
    proxy.allowedError = 0.02;
    if (withProxy) detection.addCollisionPair(drops, bone, proxy);
    PairSettings apart{Method::Proximity, 0.05};
    apart.restDistance = 0.3;
    detection.addCollisionPair(suture, suture, apart);
  }

  /// Moves everything. height: L, by which what deforms is above the rest.
  void move(double time, double height = 0.0) {
    detection.setPositions(organ, deformed(m_input.organ.positions, time, height));
    detection.setPositions(suture, deformed(m_input.suture.positions, time, height));
    detection.setPositions(drops, deformed(m_input.drops.positions, time, height));
    detection.setPositions(block, deformed(m_input.block.positions, time, height));
    const Eigen::Matrix3d turn =
        Eigen::AngleAxisd(0.3 * std::sin(time), Vector3d::UnitX()).matrix();
    detection.setTransform(tool, {turn, {0.4, 0.5, 0.1 * std::sin(time)}});
    detection.setTransform(field, {turn, {0, 0, 0}});
    detection.setTransform(bone, {turn, {0, 0, 0}});
  }

  /// The hash of all results.
  std::uint64_t hash() const {
    std::uint64_t hash = 0;
    for (const CollisionPair& pair : detection.pairs())
      hash = hash * 31 + detection.collisionData(pair.a, pair.b).hash();
    return hash;
  }

  /// Queries of every kind that prepares something.
  void query(const SpatialQueries& queries) {
    queries.findInsideVertices(drops, organ, m_inside);
    queries.findInsideVertices(drops, floor, m_inside, {.rule = InsideRule::WindingNumber});
    queries.findEmbeddedVertices(drops, block, m_embedded);
    queries.elementsWithin(organ, {0.5, 0.5, 0.5}, 0.3, m_elements);
    queries.distance(organ, floor);
    queries.firstHit({{0.5, 0.5, 5}, {0, 0, -1}});
  }

  OctreeBasedCD detection;
  GeometryId organ, floor, bone, suture, drops, block, tool, hull, field;

 private:
  const Positions& deformed(const Positions& rest, double time, double height) {
    m_moved.resize(rest.size());
    for (std::size_t v = 0; v < rest.size(); ++v)
      m_moved[v] = rest[v] + Vector3d(0.02 * std::sin(time + 5 * rest[v][1]),
                                      0.02 * std::cos(time + 3 * rest[v][0]), height);
    return m_moved;
  }

  const WholeSceneInput& m_input;
  Positions m_moved;
  std::vector<InsideVertex> m_inside;
  std::vector<EmbeddedVertex> m_embedded;
  std::vector<std::uint32_t> m_elements;
};

}  // namespace palpate::testing
