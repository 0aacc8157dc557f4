#include "Queries/NearestPair.h"

#include "Queries/PointDistances.h"
#include "Bodies/OctreeFrame.h"
#include "Math/ClosestPoint.h"
#include "Math/StableLength.h"
#include "Math/Tolerances.h"
#include "Core/Assert.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <utility>

namespace palpate {

using Eigen::Vector3d;

namespace {

/// After so many tests of pairs for each element, elements that coincide with a lower one are
/// skipped: they are equally near, and the lower one counts. To find them costs about one test
/// for each element.
constexpr double kTestsPerElement = 4.0;
/// A row of pairs of boxes costs some hundredth of a test.
constexpr double kTestsPerPairs = 0x1p-6;

/// By place: whether no lower element has the same corners and radii.
std::vector<std::uint8_t> lowestOfCoincident(const Body& geometry) {
  using Key = std::array<std::array<double, 4>, 3>;  // positions and radius of the corners
  std::vector<std::pair<Key, std::uint32_t>> keys;
  const auto& ordered = geometry.tree.ordered();
  const auto& order = geometry.tree.octree().order();
  for (std::uint32_t place = 0; place < ordered.size(); ++place) {
    Key key;
    for (std::size_t i = 0; i < 3; ++i) {
      const Vector3d p = geometry.mesh.now[ordered[place][i]];
      key[i] = {p[0], p[1], p[2], geometry.mesh.radius(ordered[place][i])};
    }
    // The order of a triangle's corners changes no distance.
    if (geometry.mesh.topology.hasFaces()) std::sort(key.begin(), key.end());
    keys.emplace_back(key, place);
  }
  std::sort(keys.begin(), keys.end(), [&](const auto& l, const auto& r) {
    return l.first < r.first || (l.first == r.first && order[l.second] < order[r.second]);
  });
  std::vector<std::uint8_t> lowest(keys.size(), 1);
  for (std::size_t i = 1; i < keys.size(); ++i)
    lowest[keys[i].second] = keys[i].first != keys[i - 1].first;
  return lowest;
}

/// The first corner of an element at this position; 3: none.
Eigen::Index cornerAt(const Body& geometry, std::uint32_t place, const Vector3d& at) {
  const Triangle& corners = geometry.tree.ordered()[place];
  return std::find_if(corners.begin(), corners.end(),
                      [&](std::uint32_t v) { return geometry.mesh.now[v] == at; }) -
         corners.begin();
}

}  // namespace

NearestPair::NearestPair(const Body& a, const Body& b)
    : m_a(a), m_b(b), m_radii(a.mesh.largestRadius + b.mesh.largestRadius) {
  PALPATE_ASSERT(!a.tree.ordered().empty() && !b.tree.ordered().empty());
}

void NearestPair::testLikely() {
  constexpr int kRounds = 4;
  std::uint32_t placeA = 0, placeB = 0;
  Vector3d point = OctreeFrame(m_b).origin();
  for (int round = 0; round < kRounds; ++round) {
    const auto onA = PointDistances(m_a, point, false).nearest(kInfinity, placeA);
    const auto onB =
        onA ? PointDistances(m_b, point - onA->closest.difference, false).nearest(kInfinity, placeB)
            : std::nullopt;
    if (!onA || !onB) break;  // beyond double's range
    const bool isSame = round > 0 && placeA == onA->place && placeB == onB->place;
    point -= onA->closest.difference;
    point -= onB->closest.difference;
    placeA = onA->place;
    placeB = onB->place;
    if (isSame) break;
  }
  test(placeA, placeB);
}

void NearestPair::test(const NearElements& elements) {
  if (m_lowestA.empty() &&
      m_tests > kTestsPerElement * (m_a.tree.ordered().size() + m_b.tree.ordered().size())) {
    m_lowestA = lowestOfCoincident(m_a);
    m_lowestB = lowestOfCoincident(m_b);
    findVertices();
  }
  std::array<Element, NearElements::kSide> all;
  std::uint32_t read = 0;
  for (std::uint32_t i = 0; i < NearElements::kSide; ++i) {
    if (elements.near[i] == 0) continue;
    m_tests += kTestsPerPairs;
    if (!m_lowestA.empty() && !m_lowestA[elements.placeA + i]) continue;
    const Element a = elementOf(m_a, elements.placeA + i);
    for (std::uint32_t bits = elements.near[i]; bits; bits &= bits - 1) {
      const auto j = static_cast<std::uint32_t>(std::countr_zero(bits));
      if (!m_lowestB.empty() && !m_lowestB[elements.placeB + j]) continue;
      if (!(read >> j & 1)) all[j] = elementOf(m_b, elements.placeB + j);
      read |= 1u << j;
      test(elements.placeA + i, a, elements.placeB + j, all[j]);
    }
  }
}

GeometryDistance NearestPair::result() const {
  PALPATE_ASSERT(m_elementA != kNoElement && m_elementB != kNoElement);
  return {surfacePointOf(m_a, m_elementA, m_best.weightsA, m_best.distance),
          surfacePointOf(m_b, m_elementB, m_best.weightsB, m_best.distance), m_best.distance};
}

bool NearestPair::AtVertex::holds(std::uint32_t place, const Body& geometry,
                                  const Vector3d& other) {
  if (known[place] == Answer::Unknown) {
    const Triangle& corners = geometry.tree.ordered()[place];
    const bool isBehind = cornerAt(geometry, place, *at) < 3 &&
                          std::none_of(corners.begin(), corners.end(), [&](std::uint32_t v) {
                            const Vector3d corner = geometry.mesh.now[v];
                            return corner != *at && comesNearer(other, *at, corner);
                          });
    known[place] = isBehind ? Answer::Yes : Answer::No;
  }
  return known[place] == Answer::Yes;
}

/// Sets the vertices of the nearest pair, if its points are vertices without radii.
void NearestPair::findVertices() {
  if (m_lowestA.empty() || m_radii > 0.0 || !std::isfinite(m_best.distance)) return;
  const auto set = [](AtVertex& side, const Body& geometry, std::uint32_t element,
                      const Vector3d& weights) {
    Eigen::Index corner = 0;
    const bool isVertex = weights.maxCoeff(&corner) == 1.0;
    std::optional<Vector3d> at;
    if (isVertex)
      at = geometry.mesh
               .now[geometry.mesh.topology.elements[element][static_cast<std::size_t>(corner)]];
    return std::exchange(side.at, at) != at;
  };
  const bool a = set(m_atA, m_a, m_elementA, m_best.weightsA),
             b = set(m_atB, m_b, m_elementB, m_best.weightsB);
  if (!a && !b) return;
  m_atA.known.assign(m_a.tree.ordered().size(), AtVertex::Answer::Unknown);
  m_atB.known.assign(m_b.tree.ordered().size(), AtVertex::Answer::Unknown);
}

void NearestPair::test(std::uint32_t placeA, const Element& a, std::uint32_t placeB,
                       const Element& b) {
  const std::uint32_t elementA = m_a.tree.octree().order()[placeA],
                      elementB = m_b.tree.octree().order()[placeB];
  const auto precedes = [&] {
    return std::pair(elementA, elementB) < std::pair(m_elementA, m_elementB);
  };
  if (m_best.distance == 0.0 && !precedes()) return;
  if (areAtVertices(placeA, placeB)) {
    if (!precedes()) return;
    m_best.weightsA = Vector3d::Unit(cornerAt(m_a, placeA, *m_atA.at));
    m_best.weightsB = Vector3d::Unit(cornerAt(m_b, placeB, *m_atB.at));
    m_elementA = elementA;
    m_elementB = elementB;
    return;
  }
  if (areFurtherApart(a, b, m_best.distance + m_radii)) return;
  ++m_tests;
  const ElementDistance found = elementDistance(a, b);
  if (!(found.distance < m_best.distance || (found.distance == m_best.distance && precedes())))
    return;
  m_best = found;
  m_elementA = elementA;
  m_elementB = elementB;
  findVertices();
  m_direction = b.point(found.weightsB) - a.point(found.weightsA);
  const double length = stableLength(m_direction);
  if (length > 0 && std::isfinite(length))
    m_direction /= length;
  else
    m_direction.setZero();
}

}  // namespace palpate
