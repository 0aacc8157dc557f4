#pragma once

#include "World.h"

#include <array>
#include <cstdint>
#include <vector>

namespace palpate::scenes {

enum class PointKind { VertexTriangle, TriangleVertex, EdgeEdge, Shape, ShapeShape };

/// A contact as a point of a picture.
///
/// at       the middle of the contact, with the positions now.
/// ids      vertex and triangle; triangle and vertex; the ends of both edges; of a contact with a
///          shape its element, 1 if the shape is the pair's first body, and the element's id.
/// weights  of the triangle's or the element's vertices, or of both edges.
struct ContactPoint {
  PointKind kind;
  std::size_t pair;  ///< of World::pairs()
  Eigen::Vector3d at, normal;
  double distance, time;
  std::array<std::uint32_t, 4> ids;
  std::array<double, 3> weights;
};

/// Contacts of all pairs in the last detection.
std::vector<ContactPoint> contactPoints(World&);

}  // namespace palpate::scenes
