#include "Math/MovingStar.h"

#include "Core/Assert.h"

#include <span>

namespace palpate {

namespace {

std::vector<Linear> motionsOf(const TouchSurroundings& around,
                              std::span<const ImpactQuery::Step> more) {
  std::vector<ImpactQuery::Step> points(around.at.begin(), around.at.end());
  for (const auto& neighbours : around.neighbours)
    points.insert(points.end(), neighbours.begin(), neighbours.end());
  for (const auto& triangles : around.triangles)
    for (const auto& corners : triangles)
      points.insert(points.end(), corners.begin(), corners.end());
  points.insert(points.end(), more.begin(), more.end());
  std::vector<Linear> motions(points.size());
  toIntegers(points, motions);
  return motions;
}

}  // namespace

TouchWay::TouchWay(const TouchSurroundings& around, bool swapped)
    : m_ofFirst(around.triangles[0].size()), m_turn(swapped ? -1 : 1) {
  const std::vector<Linear> at = motionsOf(around, {});
  m_from = difference(at[0], at[1]);
  std::size_t next = 2;
  for (std::size_t i = 0; i < around.neighbours[0].size(); ++i)
    m_displacement = difference(m_displacement, difference(at[0], at[next++]));
  for (std::size_t i = 0; i < around.neighbours[1].size(); ++i)
    m_displacement = difference(m_displacement, difference(at[next++], at[1]));
  for (; next < at.size(); next += 3) m_triangles.push_back({at[next], at[next + 1], at[next + 2]});
}

/// The sum of the second feature's normals, less those of the first.
const Quadratic& TouchWay::normals() const {
  if (m_normals) return *m_normals;
  m_normals.emplace();
  for (std::size_t i = 0; i < m_triangles.size(); ++i) {
    const auto& [a, b, c] = m_triangles[i];
    const Quadratic normal = cross(difference(b, a), difference(c, a));
    for (std::size_t k = 0; k < 3; ++k)
      for (std::size_t j = 0; j < 3; ++j)
        if (i < m_ofFirst)
          (*m_normals)[k][j] -= normal[k][j];
        else
          (*m_normals)[k][j] += normal[k][j];
  }
  return *m_normals;
}

StarTouch::StarTouch(const TouchSurroundings& around, bool swapped)
    : m_way(around, swapped), m_own(around.own) {
  PALPATE_ASSERT(!around.sectors.empty());
  std::vector<ImpactQuery::Step> points;
  for (const auto& sector : around.sectors) {
    points.push_back(sector.a);
    points.push_back(sector.b);
    m_triangles.push_back(sector.triangle);
  }
  const std::vector<Linear> all = motionsOf(around, points);
  const std::span at = std::span(all).last(points.size());
  for (std::size_t i = 0; i < around.sectors.size(); ++i) {
    const Linear a = difference(at[2 * i], all[1]), b = difference(at[2 * i + 1], all[1]);
    const auto& [first, second, triangle, endsWithEdge] = around.sectors[i];
    m_sectors.push_back({a, b, triangle});
    if (!around.isEdge) continue;
    // The triangle becomes a half-plane.
    m_sectors.push_back(endsWithEdge ? Sector{reversed(b), a, triangle}
                                     : Sector{b, reversed(a), triangle});
  }
  if (around.isClosed) return;
  if (around.isEdge) {
    const Linear edge = m_sectors[0].a, outward = reversed(m_sectors[0].b);
    m_sectors.push_back({outward, edge, kContinued});
    m_sectors.push_back({reversed(edge), outward, kContinued});
  } else {
    Linear outward = reversed(m_sectors.back().b);
    for (const Sector& sector : m_sectors) outward = difference(outward, sector.a);
    const Linear first = m_sectors.front().a, last = m_sectors.back().b;
    m_sectors.push_back({last, outward, kContinued});
    m_sectors.push_back({outward, first, kContinued});
  }
}

EdgeTouch::EdgeTouch(const ImpactQuery& query, std::array<int, 2> ends,
                     const TouchSurroundings& around, bool swapped)
    : m_ends(ends), m_way(around, swapped) {
  std::array<Linear, 4> at;
  toIntegers(query.vertices, at);
  const auto along = [&](std::size_t edge) {
    const std::size_t own = 2 * edge + (ends[edge] == 1), other = 4 * edge + 1 - own;
    return difference(at[other], at[own]);
  };
  m_a = along(0);
  m_b = along(1);
}

}  // namespace palpate
