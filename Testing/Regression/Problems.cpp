#include "Problems.h"

namespace palpate::testing {

namespace {

using Positions = std::vector<Eigen::Vector3d>;
using Triangles = std::vector<Triangle>;

const Triangles kTriangle{{0, 1, 2}};
const Triangles kTetrahedron{{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}};
const Positions kFloor{{-1, -1, 0}, {2, -1, 0}, {-1, 2, 0}};
/// Its tip, vertex 3, is below kFloor and above its interior.
const Positions kTip{{-0.25, -0.25, 1}, {0.25, -0.25, 1}, {0, 0.25, 1}, {0, 0, -0.25}};

Positions scaled(Positions positions, double factor) {
  for (Eigen::Vector3d& p : positions) p *= factor;
  return positions;
}

Positions moved(Positions positions, const Eigen::Vector3d& by) {
  for (Eigen::Vector3d& p : positions) p += by;
  return positions;
}

CollisionProblem intersection(const Positions& a, const Triangles& trianglesA, const Positions& b,
                              const Triangles& trianglesB) {
  CollisionProblem problem;
  problem.geometries = {{GeometryId{0}, a, a, trianglesA}, {GeometryId{1}, b, b, trianglesB}};
  problem.pairs = {{0, 1, {.method = Method::Intersection}, Method::Intersection}};
  return problem;
}

/// The tip is far from everything before the step.
CollisionProblem outsideRoot() {
  CollisionProblem problem = intersection(kFloor, kTriangle, kTip, kTetrahedron);
  for (CollisionProblem::Geometry& mesh : problem.geometries)
    mesh.now = moved(mesh.before, {4096, -8192, 1024});
  return problem;
}

}  // namespace

std::vector<RegressionProblem> regressionProblems() {
  const Positions upright{{0, 0.5, -1}, {0, 0.5, 1}, {1, 0.5, 1}};
  const Positions right{{0, 0, 0}, {2, 0, 0}, {0, 2, 0}};
  const Positions onFace{{0.25, 0.25, 0}, {0.25, 0.25, 1}, {0.5, 0.25, 1}};
  const double tiny = 0x1p-17;  // edges of 4e-6 to 3e-5
  return {
      {"VertexOfSecondPiercesFace",
       intersection(kFloor, kTriangle, kTip, kTetrahedron),
       {0, 1, 0, 3}},
      {"ThreeEdgesCross", intersection(right, kTriangle, upright, kTriangle), {1, 1, 1, 1}},
      {"CoplanarTriangles",
       intersection(right, kTriangle, moved(right, {0.25, 0.25, 0}), kTriangle),
       {0, 1, 2, 1}},
      {"VertexExactlyOnFace", intersection(right, kTriangle, onFace, kTriangle), {0, 1, 0, 1}},
      {"EdgesShorterThan2e-5",
       intersection(scaled(kFloor, tiny), kTriangle, scaled(kTip, tiny), kTetrahedron),
       {0, 1, 0, 3}},
      {"OutsideTheRoot", outsideRoot(), {0, 1, 0, 3}},
  };
}

}  // namespace palpate::testing
