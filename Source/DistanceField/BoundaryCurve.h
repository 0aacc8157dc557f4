#pragma once

#include "Mesh/TriangleMesh.h"
#include "Math/SolidAngle.h"

#include <Eigen/Core>

#include <cstddef>
#include <cstdint>
#include <vector>

namespace palpate {

/// The boundary of a set of triangles: the edges that triangles pass more often in one direction
/// than in the other. Vertices at one place count as one vertex. A closed and consistently oriented
/// mesh has no boundary.
///
/// The generalised winding number w of the triangles is the sum of an integer, which changes at the
/// triangles, and a part that changes smoothly. Off the boundary, the gradient of this part is the
/// integral of r x dl / 4 pi r³ along the boundary (the law of Biot and Savart).
class BoundaryCurve {
 public:
  explicit BoundaryCurve(const TriangleMesh&);

  bool isEmpty() const { return m_edges.empty(); }
  std::size_t size() const { return m_edges.size(); }                          ///< number of edges
  double length() const { return m_nodes.empty() ? 0.0 : m_nodes[0].length; }  ///< L

  /// 1/L: an upper bound of that gradient in the ball; infinity if it exceeds `most`, or if the
  /// boundary may meet the ball.
  double steepness(const Eigen::Vector3d& centre, double radius, double most) const;
  /// The winding number about a point, up to an integer: that of the triangles that join one point
  /// to the edges. They have the same boundary, so that the difference of both sets is closed.
  /// Cost     linear in the edges.
  SolidAngleShare fanNumber(const Eigen::Vector3d&) const;

 private:
  struct Edge {
    Eigen::Vector3d start, end;  ///< in the direction of more passages
    double count;                ///< of passages in one direction, less those in the other
  };
  struct Node {
    Eigen::Vector3d centre;
    double radius, length;     ///< L: of a ball around the edges; their length, times counts
    std::uint32_t begin, end;  ///< edges
    std::uint32_t second = 0;  ///< the second child; the first one comes next; 0: a leaf
  };
  void addNode(std::uint32_t begin, std::uint32_t end);

  std::vector<Edge> m_edges;
  std::vector<Node> m_nodes;
  double m_largest = 0.0;  ///< L: coordinate
};

}  // namespace palpate
