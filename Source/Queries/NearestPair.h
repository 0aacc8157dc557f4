#pragma once

#include <palpate/SpatialQueries.h>

#include "Queries/ElementDistance.h"
#include "Queries/PairTraversal.h"
#include "Bodies/Body.h"

#include <Eigen/Core>

#include <cstdint>
#include <optional>
#include <vector>

namespace palpate {

/// The nearest pair of elements of two bodies that was found so far. Both bodies have elements.
class NearestPair {
 public:
  NearestPair(const Body& a, const Body& b);

  /// Tests two elements near each other: each body's element nearest to a point of the other one,
  /// in turn.
  void testLikely();
  /// Tests the elements at two places of the octrees' orders.
  void test(std::uint32_t placeA, std::uint32_t placeB) {
    test(placeA, elementOf(m_a, placeA), placeB, elementOf(m_b, placeB));
  }
  void test(const NearElements&);

  /// L, between the elements' surfaces; infinite if there is none.
  double distance() const { return m_best.distance; }
  /// From a to b: unit, or 0.
  const Eigen::Vector3d& direction() const { return m_direction; }
  GeometryDistance result() const;

 private:
  /// Whether an element has a corner at the vertex of the nearest pair, and lies behind the plane
  /// through it across the way to the other vertex, decided exactly. Two such elements are as near
  /// as the vertices are.
  struct AtVertex {
    std::optional<Eigen::Vector3d> at{};
    enum class Answer : std::uint8_t { Unknown, No, Yes };
    std::vector<Answer> known{};  ///< by place

    bool holds(std::uint32_t place, const Body&, const Eigen::Vector3d& other);
  };

  static Element elementOf(const Body& body, std::uint32_t place) {
    return {body.mesh, body.tree.ordered()[place]};
  }
  void findVertices();
  bool areAtVertices(std::uint32_t placeA, std::uint32_t placeB) {
    return m_atA.at && m_atB.at && m_atA.holds(placeA, m_a, *m_atB.at) &&
           m_atB.holds(placeB, m_b, *m_atA.at);
  }
  void test(std::uint32_t placeA, const Element& a, std::uint32_t placeB, const Element& b);

  const Body &m_a, &m_b;
  const double m_radii;  ///< L: the largest ones of both
  double m_tests = 0;
  std::vector<std::uint8_t> m_lowestA, m_lowestB;  ///< by place; empty: all are tested
  AtVertex m_atA, m_atB;
  ElementDistance m_best;
  std::uint32_t m_elementA = kNoElement, m_elementB = kNoElement;
  Eigen::Vector3d m_direction = Eigen::Vector3d::Zero();
};

}  // namespace palpate
