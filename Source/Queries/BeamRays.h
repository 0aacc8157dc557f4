#pragma once

#include <palpate/SpatialQueries.h>

#include "Queries/RayBeam.h"
#include "Bodies/Body.h"
#include "Bodies/OctreeFrame.h"
#include "Math/Box.h"
#include "Math/RayTriangle.h"
#include "Math/Tolerances.h"

#include <array>
#include <cmath>
#include <cstddef>
#include <optional>
#include <span>

namespace palpate {

/// Neighbouring rays that traverse one body's octree as a RayBeam. w: as there.
class BeamRays {
 public:
  explicit BeamRays(const Body&);

  /// Makes a beam of the first rays that go the same way. Returns their number; 0 if there are too
  /// few for a beam.
  std::size_t start(std::span<const Ray>);
  std::size_t count() const { return m_count; }
  const RayBeam& beam() const { return m_beam; }
  const RaySegment& operator[](std::size_t ray) const { return m_rays[ray]; }
  float end(std::size_t ray) const { return m_ends[ray]; }  ///< w where it ends, at least
  /// At least the w of a ray's t.
  float upper(std::size_t ray, double t) const {
    const double reach = t * m_perT[ray];
    const double w = m_atZero[ray] + reach + m_slack +
                     kPlacedPointError * (std::abs(m_atZero[ray]) + std::abs(reach));
    return OutwardRounding::up(w);
  }

 private:
  static constexpr std::size_t kSize = RayBeam::kSize;

  /// A ray's line.
  struct Line {
    double origin[2], slope[2];  ///< on the other axes; per w
    double atZero, perT;         ///< w = atZero + t perT
    double begin, end;           ///< w of the ray's ends, at least
    double reach;                ///< of the origin's coordinates and the octree's

    double at(std::size_t k, double w) const { return origin[k] + (w - atZero) * slope[k]; }
  };
  using Sides = std::array<std::array<double, 2>, 2>;  ///< of rays: axis, at m_begin and m_end

  std::optional<Line> lineOf(const Ray&);
  bool isLongEnough(const Line&);
  bool add(const Ray&);
  void finish();

  const OctreeFrame m_frame;
  const Eigen::Vector3d m_zero;  ///< L: where the floats are 0
  bool m_hasBeams;               ///< whether the geometry can be searched by beams
  double m_extent;               ///< of the octree's root; this and what follows is in its floats
  double m_frameError;           ///< of positions, besides their share of the coordinates
  double m_perEdge;              ///< per about the mean edge of the triangles

  std::size_t m_count = 0;
  RayBeam m_beam;
  double m_begin, m_end;  ///< w between which the beam's lines are taken
  double m_slack;
  Sides m_lower, m_upper;
  // Of each ray:
  std::array<RaySegment, kSize> m_rays;
  std::array<double, kSize> m_perT, m_atZero;  ///< w = m_atZero + t m_perT
  std::array<float, kSize> m_ends;             ///< w
};

}  // namespace palpate
