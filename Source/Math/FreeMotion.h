#pragma once

#include <palpate/Settings.h>

#include <Eigen/Core>

#include <array>

// How far features may move before they come into contact. Docs/Algorithms/FreeMotion.md has the
// proofs.

namespace palpate {

/// The corners of a feature or of an element, with radii. All in L.
struct RoundPoints {
  int count = 0;
  std::array<Eigen::Vector3d, 3> positions{};
  std::array<double, 3> radii{};

  void add(const Eigen::Vector3d& position, double radius) {
    positions[count] = position;
    radii[count++] = radius;
  }
};

/// What separates the hulls of two sets of round points, p and q, along a direction. All in L.
struct SharedGap {
  double
      gap;  ///< the hulls are at least this far apart, up to rounding; negative: they may overlap
  std::array<double, 3> beyondP{}, beyondQ{};  ///< of each point: further away than the nearest

  /// How far points may move if the sets share `width` of the gap equally.
  double ofP(int i, double width) const { return 0.5 * width + beyondP[i]; }
  double ofQ(int j, double width) const { return 0.5 * width + beyondQ[j]; }
};

/// direction: unit, from q towards p. withRadii: false takes all radii as 0.
SharedGap gapAlong(const RoundPoints& p, const RoundPoints& q, const Eigen::Vector3d& direction,
                   bool withRadii = true);

/// What the rounding errors of a gap depend on. All in L.
struct GapSize {
  double largest;  ///< at least the magnitudes of coordinates, radii and the thickness
  double extent;   ///< at least the largest difference between two points in a coordinate
};

/// The box of some round points. In L.
struct RoundBox {
  Eigen::Vector3d lower, upper;

  RoundBox() = default;
  explicit RoundBox(const RoundPoints&);
  /// Whether the boxes are further apart along a coordinate axis. distance: in L.
  bool isBeyond(double distance, const RoundBox& other) const {
    for (int k = 0; k < 3; ++k)
      if (lower[k] - other.upper[k] > distance || other.lower[k] - upper[k] > distance) return true;
    return false;
  }
};

/// What separates two boxes, p and q. The gap is the widest one along a coordinate axis, and the
/// direction that from q towards p.
struct BoxGap {
  double gap;
  Eigen::Vector3d direction;
  GapSize size;
};
/// Law      fewer points never have a smaller gap or a larger size, also in the last bit.
BoxGap gapOfBoxes(const RoundBox& p, const RoundBox& q, double thickness);

/// How far apart the features of a pair are for its free motion (PairSettings::freeMotionReach).
class FreeMotionRange {
 public:
  /// radii: L, the largest of both geometries together.
  FreeMotionRange(const PairSettings&, double radii);

  /// L: what features without a contact may move towards each other. gap: L, between them, less
  /// their radii.
  double freeGap(double gap, const GapSize&) const;
  /// L: the same of features in contact, which must not pass through each other. gap: L, between
  /// them, without radii.
  static double gapOfContact(double gap, const GapSize&);
  /// L: features without radii that are further apart have a freeGap() above the reach. largest:
  /// bounds the magnitudes of all coordinates.
  double searchDistance(double largest) const;
  bool isContact(double distance) const { return distance <= m_thickness; }
  double thickness() const { return m_thickness; }
  double reach() const { return m_reach; }

 private:
  double slack(const GapSize&) const;

  double m_thickness, m_contactDistance, m_reach;
  bool m_isEarly;  ///< the method may report features that come nearly within the thickness
  double m_early;  ///< L: by which it does, for its time tolerance
};

}  // namespace palpate
