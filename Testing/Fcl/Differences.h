#pragma once

#include <palpate/FclEngine.h>
#include <palpate/OctreeBasedCD.h>

#include "Common/ShapeTruth.h"

#include <optional>
#include <string>
#include <vector>

/// FCL beside Palpate on the same shapes, and who is right where they differ.
namespace palpate::testing {

/// Two shapes in one engine, moved from question to question.
template <class Engine>
class ShapePair {
 public:
  ShapePair(const AnalyticalGeometry& a, const AnalyticalGeometry& b, double thickness)
      : m_a(m_engine.addAnalyticalGeometry(a)), m_b(m_engine.addAnalyticalGeometry(b)) {
    m_engine.addCollisionPair(m_a, m_b, {Method::Proximity, thickness});
  }
  std::optional<ShapeShapeContact> at(const PlacedShape& a, const PlacedShape& b) {
    m_engine.setTransform(m_a, a.rotation, a.translation);
    m_engine.setTransform(m_b, b.rotation, b.translation);
    m_engine.detectCollision();
    const auto contacts = m_engine.collisionData(m_a, m_b).shapeShape();
    if (contacts.empty()) return {};
    return contacts[0];
  }

 private:
  Engine m_engine;
  GeometryId m_a, m_b;
};

/// The signed distance as what it is: the most that any direction parts them. Searched over a
/// thousand directions, those of all facets and edges of cornered bodies, and `hints`, the best of
/// which are refined.
double searchedDistance(const PlacedShape& a, const PlacedShape& b,
                        const std::vector<Vector3d>& hints);

/// How random shapes lie: at random; along the axes, on a grid; at random, a thousandth as large.
enum class Layout { Any, Grid, Small };

/// What may be done wrong in how many configurations of a pair of kinds. Lengths are over the size
/// of the shapes.
struct Tally {
  int configurations = 0, overlaps = 0;
  int differ = 0;                      ///< FCL's distance from Palpate's, by more than kTolerance
  int fclWrong = 0, palpateWrong = 0;  ///< of those, by the search
  int exchanged = 0;                   ///< FCL's distance of the exchanged pair is another
  /// libccd is wrong on whether they overlap by more than kTolerance; and on how deep.
  int epaMissed = 0, mprMissed = 0, epaWrong = 0, mprWrong = 0;
  double worstFcl = 0, worstPalpate = 0, worstEpa = 0, worstMpr = 0;
};
constexpr double kTolerance = 1e-5;

Tally compare(const std::string& kindA, const std::string& kindB, Layout, int configurations);

/// The kinds that it knows.
const std::vector<std::string>& shapeKinds();

}  // namespace palpate::testing
