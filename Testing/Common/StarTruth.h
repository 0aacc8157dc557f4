#pragma once

#include <palpate/Types.h>

#include "Unit/Math/RationalOracle.h"

#include <algorithm>
#include <optional>
#include <random>
#include <vector>

namespace palpate::oracle {

/// The triangles around a vertex, or an edge, of a surface, continued without end, in rationals. It
/// follows a ray to the first triangle that it meets, and takes none of the library's decisions.
class StarTruth {
 public:
  /// feature: its vertices, one or two. The star has those of the triangles that hold them all.
  template <class At>
  StarTruth(const std::vector<Triangle>& triangles, const std::vector<std::uint32_t>& feature,
            const At& at)
      : m_isEdge(feature.size() == 2), m_origin(toRational(at(feature[0]))) {
    for (const Triangle& t : triangles) {
      const auto first = std::find(t.begin(), t.end(), feature[0]) - t.begin();
      if (first == 3 || (m_isEdge && std::find(t.begin(), t.end(), feature[1]) == t.end()))
        continue;
      const std::uint32_t a = t[(first + 1) % 3], b = t[(first + 2) % 3];
      m_rim.push_back({a, b});
      m_sectors.push_back({toRational(at(a)) - m_origin, toRational(at(b)) - m_origin,
                           m_isEdge && b == feature[1]});
    }
    m_feature = feature;
  }

  /// Whether each edge that holds the feature is in two of the triangles, in opposite directions.
  bool isClosed() const {
    const auto count = [&](std::size_t corner, std::uint32_t v) {
      return std::count_if(m_rim.begin(), m_rim.end(),
                           [&](const auto& ends) { return ends[corner] == v; });
    };
    if (m_isEdge) return count(0, m_feature[1]) == 1 && count(1, m_feature[1]) == 1;
    return std::all_of(m_rim.begin(), m_rim.end(), [&](const auto& ends) {
      return count(0, ends[0]) == 1 && count(1, ends[0]) == 1 && count(0, ends[1]) == 1 &&
             count(1, ends[1]) == 1;
    });
  }

  bool holds(const Eigen::Vector3d& p) const {
    const Vector d = toRational(p) - m_origin;
    return std::any_of(m_sectors.begin(), m_sectors.end(), [&](const Sector& sector) {
      const Vector normal = cross(sector.a, sector.b);
      return dot(normal, normal) != 0 && dot(normal, d) == 0 && place(sector, d) >= 0;
    });
  }

  /// Whether the line from the feature to p begins strictly inside.
  bool hasInside(const Eigen::Vector3d& p) const {
    if (holds(p)) return false;
    const Vector d = toRational(p) - m_origin;
    const auto target = std::find_if(m_sectors.begin(), m_sectors.end(),
                                     [&](const Sector& s) { return dot(cross(s.a, s.b), d) != 0; });
    if (target == m_sectors.end()) return false;
    std::mt19937 random(1);
    for (;;) {
      const Rational s = 1 + random() % 1000, t = 1 + random() % 1000;
      if (const auto found = firstSide(d, s * target->a + t * target->b)) return *found < 0;
    }
  }

 private:
  struct Sector {
    Vector a, b;
    bool endsInB;  ///< of an edge: b leads along it, else a
  };

  /// Of a point in a sector's plane: 1 inside, 0 on the border, -1 outside.
  int place(const Sector& sector, const Vector& d) const {
    const Vector normal = cross(sector.a, sector.b);
    const int ofA = sgn(dot(cross(d, sector.b), normal)),
              ofB = sgn(dot(cross(sector.a, d), normal));
    if (m_isEdge) return sector.endsInB ? ofA : ofB;
    return std::min(ofA, ofB);
  }

  /// On which side of the first sector on the way to `end` the point d is. Nothing if the way meets
  /// a border.
  std::optional<int> firstSide(const Vector& d, const Vector& end) const {
    std::optional<int> side;
    Rational least = 2;
    for (const Sector& sector : m_sectors) {
      const Vector normal = cross(sector.a, sector.b);
      const Rational from = dot(normal, d), to = dot(normal, end);
      if (from == to || from == 0) continue;
      const Rational t = from / (from - to);
      if (t < 0 || t > 1) continue;
      const int there = place(sector, d + t * (end - d));
      if (there == 0) return {};
      if (there > 0 && t < least) least = t, side = sgn(from);
    }
    return side;
  }

  bool m_isEdge;
  Vector m_origin;
  std::vector<std::uint32_t> m_feature;
  std::vector<Sector> m_sectors;
  std::vector<std::array<std::uint32_t, 2>> m_rim;  ///< per sector: its other vertices
};

}  // namespace palpate::oracle
