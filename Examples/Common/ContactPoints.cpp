#include "ContactPoints.h"

#include <cmath>

namespace palpate::scenes {

using Eigen::Vector3d;

std::vector<ContactPoint> contactPoints(World& world) {
  std::vector<ContactPoint> points;
  for (std::size_t pair = 0; pair < world.pairs().size(); ++pair) {
    const auto& [a, b, gap] = world.pairs()[pair];
    const CollisionData& data = world.contacts(a, b);
    const auto middle = [&](const auto& contact, std::array<World::BodyId, 4> bodies) {
      const auto [vertices, weights] = stencil(contact);
      Vector3d sum = Vector3d::Zero();
      for (std::size_t i = 0; i < 4; ++i)
        sum += std::abs(weights[i]) / 2 * world.positions(bodies[i])[vertices[i]];
      return sum;
    };
    const auto three = [](const Vector3d& w) { return std::array{w[0], w[1], w[2]}; };
    for (const auto& c : data.vertexTriangle())
      points.push_back({PointKind::VertexTriangle,
                        pair,
                        middle(c, {a, b, b, b}),
                        c.normal,
                        c.distance,
                        c.timeOfImpact,
                        {c.vertex, c.triangle},
                        three(c.weights)});
    for (const auto& c : data.triangleVertex())
      points.push_back({PointKind::TriangleVertex,
                        pair,
                        middle(c, {b, a, a, a}),
                        c.normal,
                        c.distance,
                        c.timeOfImpact,
                        {c.triangle, c.vertex},
                        three(c.weights)});
    for (const auto& c : data.edgeEdge())
      points.push_back({PointKind::EdgeEdge,
                        pair,
                        middle(c, {a, a, b, b}),
                        c.normal,
                        c.distance,
                        c.timeOfImpact,
                        {c.edgeA[0], c.edgeA[1], c.edgeB[0], c.edgeB[1]},
                        {c.weightA, c.weightB, 0}});
    const bool shapeFirst = world.bodies()[a].type == GeometryType::Shape;
    for (const auto& c : data.shape())
      points.push_back({PointKind::Shape,
                        pair,
                        (c.point + c.pointOnShape) / 2,
                        c.normal,
                        c.distance,
                        c.timeOfImpact,
                        {static_cast<std::uint32_t>(c.element), shapeFirst, c.id},
                        three(c.weights)});
    for (const auto& c : data.shapeShape())
      points.push_back({PointKind::ShapeShape,
                        pair,
                        (c.pointA + c.pointB) / 2,
                        c.normal,
                        c.distance,
                        c.timeOfImpact,
                        {},
                        {}});
  }
  return points;
}

}  // namespace palpate::scenes
