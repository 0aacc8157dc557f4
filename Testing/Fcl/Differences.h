#pragma once

#include <palpate/FclEngine.h>
#include <palpate/OctreeBasedCD.h>

#include "Common/ShapeTruth.h"

#include <optional>
#include <string>
#include <vector>

/// Compares FCL with Palpate on the same shapes, and decides which is right where they differ.
namespace palpate::testing {

/// Two shapes in one engine, moved for each query.
template <class Engine>
class ShapePair {
 public:
  ShapePair(const AnalyticalGeometry& a, const AnalyticalGeometry& b, double thickness)
      : m_a(m_engine.addAnalyticalGeometry(a)), m_b(m_engine.addAnalyticalGeometry(b)) {
    m_engine.addCollisionPair(m_a, m_b, {Method::Proximity, thickness});
  }
  std::optional<ShapeShapeContact> at(const PlacedShape& a, const PlacedShape& b) {
    m_engine.setTransform(m_a, {a.rotation, a.translation});
    m_engine.setTransform(m_b, {b.rotation, b.translation});
    m_engine.detectCollision();
    const auto contacts = m_engine.collisionData(m_a, m_b).shapeShape();
    if (contacts.empty()) return {};
    return contacts[0];
  }

 private:
  Engine m_engine;
  GeometryId m_a, m_b;
};

/// The signed distance by its definition: the largest gap along any direction. The search covers a
/// thousand directions, those of all facets and edges of polyhedra, and `hints`. It refines the
/// best ones.
double searchedDistance(const PlacedShape& a, const PlacedShape& b,
                        const std::vector<Vector3d>& hints);

/// Layouts of random shapes: at random; along the axes, on a grid; at random and a thousandth as
/// large.
enum class Layout { Any, Grid, Small };

/// Counts of wrong results over the configurations of one pair of shape types. Lengths are relative
/// to the size of the shapes.
struct Tally {
  int configurations = 0, overlaps = 0;
  int differ = 0;  ///< FCL's and Palpate's distances differ by more than kTolerance
  int fclWrong = 0, palpateWrong = 0;  ///< of those, wrong by the search
  int exchanged = 0;                   ///< FCL's distance of the exchanged pair differs
  /// libccd is wrong on overlaps deeper than kTolerance, and on the depth.
  int epaWrongOverlap = 0, mprWrongOverlap = 0, epaWrong = 0, mprWrong = 0;
  double worstFcl = 0, worstPalpate = 0, worstEpa = 0, worstMpr = 0;
};
constexpr double kTolerance = 1e-5;

Tally compare(const std::string& typeA, const std::string& typeB, Layout, int configurations);

/// The shape types that compare() knows.
const std::vector<std::string>& shapeTypes();

}  // namespace palpate::testing
