#pragma once

#include <palpate/FeaturePairs.h>

#include "Common/StarTruth.h"
#include "Frame/Placement.h"
#include "Unit/Math/ImpactOracle.h"
#include "Unit/Math/RationalOracle.h"
#include "Math/Tolerances.h"

#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <utility>
#include <vector>

namespace palpate::testing {

/// Whether a scene has a contact by the method's definition, for its positions in double. Computed
/// in rational arithmetic, by triangle and feature. It uses nothing of the library but the
/// definitions.
class ExactContacts {
 public:
  /// Either: the thickness is within the method's stated error.
  enum class Answer { No, Yes, Either };
  using Ids = std::array<std::uint32_t, 5>;  ///< as in PlainContact

  ExactContacts(const StepScene& scene, const PairSettings& settings, bool self)
      : m_settings(settings),
        m_a{scene.a, scene.aBefore},
        m_b{self ? scene.a : scene.b, self ? scene.aBefore : scene.bBefore},
        m_self(self) {
    if (settings.method != Method::Intersection) return;
    m_depthsOfA = depths(m_a, m_b, m_crossingsOfA);
    if (!self) m_depthsOfB = depths(m_b, m_a, m_crossingsOfB);
    addBorders(m_a, m_b, false);
    addBorders(m_b, m_a, true);
    addRims(m_a, m_b, false);
    addRims(m_b, m_a, true);
  }

  Answer has(const Ids& ids) const {
    switch (ids[0]) {
      case PlainContact::VertexTriangle:
        return vertexTriangle(m_a, m_b, ids);
      case PlainContact::TriangleVertex:
        return vertexTriangle(m_b, m_a, ids);
      case PlainContact::VertexVertex:
        return distinct(m_a, m_b, {ids[0], ids[1], ids[2], kNone, kNone});
      default:
        return edges(Segment{ids[1], ids[2]}, Segment{ids[3], ids[4]});
    }
  }

  bool intersect(const ElementPair& pair) const { return Meeting(*this, pair.a, pair.b).any; }

 private:
  static constexpr std::uint32_t kNone = ~0u;
  using Vector3d = Eigen::Vector3d;
  using Rational = oracle::Rational;
  struct Moving {
    const Mesh& mesh;
    const std::vector<Vector3d>& before;
    const Vector3d& operator[](std::uint32_t v) const { return mesh.positions[v]; }
    const std::vector<Triangle>& triangles() const { return mesh.triangles; }
  };
  static bool holds(const Triangle& t, std::uint32_t v) {
    return t[0] == v || t[1] == v || t[2] == v;
  }
  static bool holds(const Triangle& t, const Segment& e) {
    return holds(t, e[0]) && holds(t, e[1]);
  }
  /// Triangles that hold a vertex or an edge.
  template <class Feature>
  static std::vector<std::uint32_t> at(const Moving& m, const Feature& feature) {
    std::vector<std::uint32_t> ids;
    for (std::uint32_t t = 0; t < m.triangles().size(); ++t)
      if (holds(m.triangles()[t], feature)) ids.push_back(t);
    return ids;
  }

  // ---- Proximity ----

  Answer within(const Rational& square, const std::array<Vector3d, 4>& positions) const {
    const double beyond = mpf_class(oracle::root(square) - m_settings.thickness).get_d();
    if (std::abs(beyond) <= 8 * oracle::ulpOfLargestDifference(positions)) return Answer::Either;
    return beyond < 0 ? Answer::Yes : Answer::No;
  }

  static std::array<Vector3d, 4> positionsOf(const Moving& vertices, std::uint32_t v,
                                             const Moving& triangles, std::uint32_t t) {
    const auto& [a, b, c] = triangles.triangles()[t];
    return {vertices[v], triangles[a], triangles[b], triangles[c]};
  }
  static oracle::Closest closest(const std::array<Vector3d, 4>& p) {
    return oracle::vertexTriangle(p[0], p[1], p[2], p[3]);
  }

  /// ids: vertex, then the corners of the triangles' mesh between which the closest point lies.
  Answer distinct(const Moving& vertices, const Moving& triangles, const Ids& ids) const {
    std::vector<std::uint32_t> corners;
    for (int i = 2; i < 5; ++i)
      if (ids[i] != kNone) corners.push_back(ids[i]);
    Rational nearest = -1;
    Answer answer = Answer::No;
    std::vector<Rational> squares;
    for (std::uint32_t t = 0; t < triangles.triangles().size(); ++t) {
      const Triangle& triangle = triangles.triangles()[t];
      if (m_self && holds(triangle, ids[1])) continue;
      if (!std::all_of(corners.begin(), corners.end(),
                       [&](std::uint32_t c) { return holds(triangle, c); }))
        continue;
      const auto positions = positionsOf(vertices, ids[1], triangles, t);
      const oracle::Closest point = closest(positions);
      if (nearest < 0 || point.square < nearest) nearest = point.square;
      std::size_t between = 0;
      bool onFeature = true;
      for (int i = 0; i < 3; ++i) {
        if (point.weights[i] == 0) continue;
        ++between;
        onFeature &= std::find(corners.begin(), corners.end(), triangle[i]) != corners.end();
      }
      if (!onFeature || between != corners.size()) continue;
      squares.push_back(point.square);
      answer = within(point.square, positions);
    }
    return squares.empty() || nearest < squares.front() ? Answer::No : answer;
  }

  // ---- Intersection ----

  /// For each vertex behind the other mesh, the triangle of its contact.
  using Depths = std::map<std::uint32_t, std::uint32_t>;
  /// For each vertex behind, its edges that cross a triangle of the other mesh.
  using Crossings = std::map<std::uint32_t, std::set<std::pair<Segment, std::uint32_t>>>;

  /// How two triangles intersect, in rationals: touching features, and edges that cross the other.
  struct Meeting {
    bool cornersOfA[3] = {}, cornersOfB[3] = {}, edges[3][3] = {};  ///< touch
    bool throughB[3] = {}, throughA[3] = {};
    bool touch = false, any = false;

    Meeting(const ExactContacts& scene, std::uint32_t s, std::uint32_t t) {
      const Triangle &a = scene.m_a.triangles()[s], &b = scene.m_b.triangles()[t];
      const auto p = [&](int i) { return scene.m_a[a[i % 3]]; };
      const auto q = [&](int i) { return scene.m_b[b[i % 3]]; };
      for (int i = 0; i < 3; ++i) {
        cornersOfA[i] = oracle::vertexTriangle(p(i), q(0), q(1), q(2)).square == 0;
        cornersOfB[i] = oracle::vertexTriangle(q(i), p(0), p(1), p(2)).square == 0;
        for (int j = 0; j < 3; ++j)
          edges[i][j] = oracle::edgeEdge(p(i), p(i + 1), q(j), q(j + 1)).square == 0;
        throughB[i] = crosses(p(i), p(i + 1), q(0), q(1), q(2));
        throughA[i] = crosses(q(i), q(i + 1), p(0), p(1), p(2));
        touch |= cornersOfA[i] || cornersOfB[i] || edges[i][0] || edges[i][1] || edges[i][2];
        any |= throughB[i] || throughA[i];
      }
      any |= touch;
    }
    static int side(const Vector3d& a, const Vector3d& b, const Vector3d& c, const Vector3d& d) {
      using namespace oracle;
      const auto from = toRational(a);
      return sgn(dot(cross(toRational(b) - from, toRational(c) - from), toRational(d) - from));
    }
    static bool crosses(const Vector3d& p, const Vector3d& q, const Vector3d& a, const Vector3d& b,
                        const Vector3d& c) {
      if (side(a, b, c, p) * side(a, b, c, q) >= 0) return false;
      const int x = side(p, q, a, b), y = side(p, q, b, c), z = side(p, q, c, a);
      return x != 0 && x == y && y == z;
    }
    /// Of two triangles that pierce each other: an end of a crossing edge is behind the other mesh,
    /// or a corner of which an edge crosses a triangle at a vertex of the other one.
    bool isBehind(const ExactContacts& scene, std::uint32_t s, std::uint32_t t) const {
      const Triangle &a = scene.m_a.triangles()[s], &b = scene.m_b.triangles()[t];
      const auto stands = [](const Crossings& crossings, const Moving& others, std::uint32_t corner,
                             bool isEnd, const Triangle& other) {
        const auto found = crossings.find(corner);
        return found != crossings.end() &&
               (isEnd || std::ranges::any_of(found->second, [&](const auto& crossing) {
                  return std::ranges::any_of(others.triangles()[crossing.second],
                                             [&](std::uint32_t v) { return holds(other, v); });
                }));
      };
      bool found = false;
      for (int i = 0; i < 3; ++i) {
        const int last = (i + 2) % 3;
        found |= stands(scene.m_crossingsOfA, scene.m_b, a[i], throughB[i] || throughB[last], b) ||
                 stands(scene.crossingsOf(true), scene.m_a, b[i], throughA[i] || throughA[last], a);
      }
      return found;
    }
    static int count(const bool (&edges)[3]) { return edges[0] + edges[1] + edges[2]; }
    /// Corner i lies between the two edges that cross.
    static bool between(const bool (&edges)[3], int i) {
      return count(edges) == 2 && edges[i] && edges[(i + 2) % 3];
    }
    bool cornerOfA(int i) const { return touch ? cornersOfA[i] : between(throughB, i); }
    bool cornerOfB(int i) const { return touch ? cornersOfB[i] : between(throughA, i); }
    bool edgePair(int i, int j) const {
      return touch ? edges[i][j] : count(throughB) == 1 && throughB[i] && throughA[j];
    }
  };

  /// What crossing edges of two triangles pass below, on their way in and out of the other mesh.
  struct Below {
    std::set<std::pair<Segment, Segment>> edges;  ///< of a and b, that have crossed
    bool stands = false;                          ///< other contacts stand for the triangles
    bool unsure = false;                          ///< ends of edges are nearest
  };
  Below belowOf(const Meeting& meeting, std::uint32_t s, std::uint32_t t) const {
    Below below;
    for (int i = 0; i < 3; ++i) {
      if (meeting.throughB[i]) addBelow(m_a, m_b, false, {s, i}, t, below);
      if (meeting.throughA[i]) addBelow(m_b, m_a, true, {t, i}, s, below);
    }
    below.stands |= !below.edges.empty();
    return below;
  }
  void addBelow(const Moving& own, const Moving& surface, bool ofB,
                const std::pair<std::uint32_t, int>& edge, std::uint32_t crossed,
                Below& below) const {
    const Triangle& corners = own.triangles()[edge.first];
    const Segment e = sorted(corners[edge.second], corners[(edge.second + 1) % 3]);
    const Depths& depths = ofB && !m_self ? m_depthsOfA : m_self ? m_depthsOfA : m_depthsOfB;
    const Triangle& here = surface.triangles()[crossed];
    for (std::uint32_t u = 0; u < surface.triangles().size(); ++u) {
      const Triangle& there = surface.triangles()[u];
      if (!mayMeet(surface, u, e) ||
          side(surface, u, own[e[0]]) * side(surface, crossed, own[e[0]]) >= 0 ||
          side(surface, u, own[e[0]]) * side(surface, u, own[e[1]]) >= 0 ||
          crossedFeature(own[e[0]], own[e[1]], surface, u).empty())
        continue;
      for (const std::uint32_t v : here) below.stands |= holds(there, v) && depths.contains(v);
      using namespace oracle;
      const Vector apart = crossing(own[e[0]], own[e[1]], surface, u) -
                           crossing(own[e[0]], own[e[1]], surface, crossed);
      addRidge(surface, ofB, e, {crossed, u}, oracle::root(oracle::dot(apart, apart)), {}, below);
    }
  }
  /// Whether the closest points of two segments are certainly not between the ends of both. Spares
  /// rational arithmetic.
  static bool certainlyNotBetweenEnds(const Vector3d& p, const Vector3d& q, const Vector3d& r,
                                      const Vector3d& s) {
    const Vector3d u = q - p, v = s - r, from = r - p, normal = u.cross(v);
    const double square = normal.squaredNorm(), size = std::max(u.norm(), v.norm()) + from.norm();
    if (!(square > 1e-6 * size * size * size * size)) return false;
    const double ofU = from.cross(v).dot(normal) / square, ofV = from.cross(u).dot(normal) / square;
    return std::min(ofU, ofV) < -1e-6 || std::max(ofU, ofV) > 1 + 1e-6;
  }
  /// Adds the nearest ridge that an edge has crossed, of those at the corners of triangles.
  /// wayOut: the normal of the edge's end, of any length; nothing: any ridge may lead out.
  void addRidge(const Moving& surface, bool ofB, const Segment& edge,
                const std::set<std::uint32_t>& triangles, const mpf_class& distance,
                const std::optional<oracle::Vector>& wayOut, Below& below) const {
    struct Near {
      Rational square;
      Answer isCrossed;
      std::pair<Segment, Segment> edges;
    };
    std::set<Segment> ridges;
    for (const std::uint32_t t : triangles)
      for (const std::uint32_t corner : surface.triangles()[t])
        for (const std::uint32_t around : at(surface, corner))
          for (const std::uint32_t other : surface.triangles()[around])
            if (other != corner) ridges.insert(sorted(corner, other));
    std::vector<Near> near;
    for (const Segment& ridge : ridges) {
      if (certainlyNotBetweenEnds(ofB ? m_b[edge[0]] : m_a[edge[0]],
                                  ofB ? m_b[edge[1]] : m_a[edge[1]], surface[ridge[0]],
                                  surface[ridge[1]]))
        continue;
      if (m_self && (holds({ridge[0], ridge[1], ridge[1]}, edge[0]) ||
                     holds({ridge[0], ridge[1], ridge[1]}, edge[1])))
        continue;
      const std::vector<std::uint32_t> both = at(surface, ridge);
      if (both.size() != 2) continue;
      for (const std::uint32_t v : surface.triangles()[both[1]])
        if (v != ridge[0] && v != ridge[1] && side(surface, both[0], surface[v]) < 0) {
          const Segment &p = ofB ? ridge : edge, &q = ofB ? edge : ridge;
          const oracle::Closest points =
              oracle::edgeEdge(m_a[p[0]], m_a[p[1]], m_b[q[0]], m_b[q[1]]);
          if (!points.interior) continue;
          const Answer isCrossed = haveCrossed(p, q);
          const mpf_class beyond = oracle::root(points.square) - distance;
          if (wayOut) {
            const mpf_class along(ofB ? oracle::dot(points.difference, *wayOut)
                                      : Rational(-oracle::dot(points.difference, *wayOut)),
                                  400);
            const double cosine = mpf_class(along / oracle::root(points.square) /
                                            oracle::root(oracle::dot(*wayOut, *wayOut)))
                                      .get_d();
            if (cosine < 0.7 - 1e-9) continue;
            if (cosine < 0.7 + 1e-9 && isCrossed != Answer::No) below.unsure = true;
          }
          if (abs(beyond) <= 1e-9 * distance)
            near.push_back(
                {points.square, isCrossed == Answer::No ? isCrossed : Answer::Either, {p, q}});
          else if (beyond < 0)
            near.push_back({points.square, isCrossed, {p, q}});
        }
    }
    std::stable_sort(near.begin(), near.end(),
                     [](const Near& l, const Near& r) { return l.square < r.square; });
    std::erase_if(near, [](const Near& each) { return each.isCrossed == Answer::No; });
    if (near.empty()) return;
    const auto isAsNear = [&](const Near& each) {
      return each.square.get_d() <= (1 + 1e-9) * near.front().square.get_d();
    };
    const auto count = std::count_if(near.begin(), near.end(), isAsNear);
    if (count > 1 || near.front().isCrossed == Answer::Either)
      below.unsure = true;
    else
      below.edges.insert(near.front().edges);
  }
  static Segment sorted(std::uint32_t p, std::uint32_t q) {
    return {std::min(p, q), std::max(p, q)};
  }

  Answer haveCrossed(const Segment& p, const Segment& q) const {
    const oracle::Closest points = oracle::edgeEdge(m_a[p[0]], m_a[p[1]], m_b[q[0]], m_b[q[1]]);
    if (!points.interior) return Answer::Either;
    using namespace oracle;
    const Vector up = points.difference, down = Rational(-1) * up;
    return isBelow(m_b, q, up) && isBelow(m_a, p, down) ? Answer::Yes : Answer::No;
  }
  /// Whether a direction from an edge leads below the triangles around it.
  static bool isBelow(const Moving& m, const Segment& edge, const oracle::Vector& direction) {
    using namespace oracle;
    const std::vector<std::uint32_t> around = at(m, edge);
    std::size_t below = 0;
    mpf_class most = -1, sum = 0;  // of the sines above the triangles
    bool isConvex = true;
    for (const std::uint32_t t : around) {
      const auto& [a, b, c] = m.triangles()[t];
      const Vector origin = toRational(m[a]);
      const Vector normal = cross(toRational(m[b]) - origin, toRational(m[c]) - origin);
      const Rational above = dot(direction, normal);
      below += above < 0;
      if (dot(normal, normal) != 0) {
        const mpf_class sine =
            mpf_class(above, 400) / root(dot(normal, normal)) / root(dot(direction, direction));
        most = std::max(most, sine);
        sum += sine;
      }
      for (const std::uint32_t v : m.triangles()[around.back()])
        if (around.size() == 2 && t == around[0] && !holds({edge[0], edge[1], edge[1]}, v))
          isConvex = side(m, t, m[v]) < 0;
    }
    if (around.size() == 2 && most <= kTouchAngle && sum < -kTouchAngle) return true;
    return isConvex ? below == around.size() : below > 0;
  }

  /// A triangle and the corners of its feature that holds a point.
  struct Place {
    std::uint32_t triangle;
    Rational square;
    std::set<std::uint32_t> feature;
  };

  bool mayMeet(const Moving& others, std::uint32_t t, const Segment& edge) const {
    return !(m_self &&
             (holds(others.triangles()[t], edge[0]) || holds(others.triangles()[t], edge[1])));
  }
  static int side(const Moving& others, std::uint32_t t, const Vector3d& p) {
    const auto& [a, b, c] = others.triangles()[t];
    return Meeting::side(others[a], others[b], others[c], p);
  }

  /// The corners of the feature of triangle t that a segment with its ends strictly on different
  /// sides passes through; empty if it misses the triangle.
  static std::set<std::uint32_t> crossedFeature(const Vector3d& p, const Vector3d& q,
                                                const Moving& others, std::uint32_t t) {
    const Triangle& corners = others.triangles()[t];
    std::set<std::uint32_t> feature(corners.begin(), corners.end());
    int signs[3], most = 0, least = 0;
    for (int i = 0; i < 3; ++i) {
      signs[i] = Meeting::side(p, q, others[corners[i]], others[corners[(i + 1) % 3]]);
      most = std::max(most, signs[i]), least = std::min(least, signs[i]);
    }
    if (most > 0 && least < 0) return {};
    for (int i = 0; i < 3; ++i)
      if (signs[i] == 0) feature.erase(corners[(i + 2) % 3]);
    return feature;
  }

  Place place(const Vector3d& p, const Moving& others, std::uint32_t t) const {
    const Triangle& corners = others.triangles()[t];
    const oracle::Closest found =
        oracle::vertexTriangle(p, others[corners[0]], others[corners[1]], others[corners[2]]);
    Place result{t, found.square, {}};
    for (int i = 0; i < 3; ++i)
      if (found.weights[i] != 0) result.feature.insert(corners[i]);
    return result;
  }

  /// 1 if the segment from p to q leaves the surface in a feature, -1 if it enters it. sides: those
  /// of the crossed triangles on which p is.
  static int leavesIn(const Moving& others, const std::set<std::uint32_t>& feature,
                      const std::set<int>& sides, const Vector3d& p, const Vector3d& q) {
    const int sense = sides.size() == 1 ? -*sides.begin() : 0;
    if (feature.size() == 3) return sense;
    const oracle::StarTruth star(others.triangles(), {feature.begin(), feature.end()},
                                 [&](std::uint32_t v) { return others[v]; });
    if (star.isClosed()) return star.hasInside(p) - star.hasInside(q);
    return star.holds(p) || star.holds(q) ? 0 : sense;
  }

  const Depths& depthsOf(bool ofB) const { return ofB && !m_self ? m_depthsOfB : m_depthsOfA; }
  const Crossings& crossingsOf(bool ofB) const {
    return ofB && !m_self ? m_crossingsOfB : m_crossingsOfA;
  }
  static Answer isAbove(const mpf_class& value, double limit, double error) {
    if (abs(value - limit) <= error) return Answer::Either;
    return value > limit ? Answer::Yes : Answer::No;
  }
  static Answer both(Answer l, Answer r) {
    if (l == Answer::No || r == Answer::No) return Answer::No;
    return l == Answer::Yes ? r : l;
  }

  /// The triangles at a feature on the border of a surface; none at another feature.
  static std::vector<std::uint32_t> atBorder(const Moving& surface,
                                             const std::set<std::uint32_t>& feature) {
    if (feature.size() == 3) return {};
    const std::uint32_t p = *feature.begin(), q = *feature.rbegin();
    if (feature.size() == 2) {
      const std::vector<std::uint32_t> around = at(surface, Segment{p, q});
      return around.size() == 1 ? around : std::vector<std::uint32_t>{};
    }
    const oracle::StarTruth star(surface.triangles(), {p},
                                 [&](std::uint32_t v) { return surface[v]; });
    return star.isClosed() ? std::vector<std::uint32_t>{} : at(surface, p);
  }

  /// The contacts of edges from vertices beyond a border with borders that these pass below.
  void addBorders(const Moving& vertices, const Moving& others, bool ofB) {
    if (ofB && m_self) return;
    using namespace oracle;
    for (const auto& [vertex, all] : crossingsOf(ofB)) {
      const Vector3d& p = vertices[vertex];
      const std::uint32_t nearest = depthsOf(ofB).at(vertex);
      const auto [a, b, c] = others.triangles()[nearest];
      const oracle::Closest foot = oracle::vertexTriangle(p, others[a], others[b], others[c]);
      const std::set<std::uint32_t> feature = place(p, others, nearest).feature;
      const std::vector<std::uint32_t> around = atBorder(others, feature);
      if (around.empty()) continue;
      Answer isBeyond = Answer::Yes;
      std::array<mpf_class, 3> outward{mpf_class(0, 400), mpf_class(0, 400), mpf_class(0, 400)};
      const mpf_class depth = root(foot.square);
      for (const std::uint32_t t : around) {
        const auto [i, j, k] = others.triangles()[t];
        const Vector from = toRational(others[i]),
                     normal = cross(toRational(others[j]) - from, toRational(others[k]) - from),
                     aside = cross(foot.difference, normal);
        const mpf_class size = root(dot(normal, normal));
        if (size == 0) {  // every way is along it
          isBeyond = Answer::No;
          break;
        }
        isBeyond = both(isBeyond, isAbove(root(dot(aside, aside)) / size / depth, kTouchAngle,
                                          1e-6 * kTouchAngle));
        for (int x = 0; x < 3; ++x) outward[x] += mpf_class(normal[x], 400) / size;
      }
      if (isBeyond == Answer::No) continue;
      const mpf_class size = sqrt(
          mpf_class(outward[0] * outward[0] + outward[1] * outward[1] + outward[2] * outward[2]));
      Answer stands = Answer::No;
      if (isClosed(vertices))
        for (const std::uint32_t v : feature)
          if (depthsOf(!ofB).contains(v)) stands = Answer::Yes;
      for (const auto& [edge, triangle] : all) {
        std::set<std::uint32_t> corners(others.triangles()[triangle].begin(),
                                        others.triangles()[triangle].end());
        for (const std::uint32_t t : around)
          corners.insert(others.triangles()[t].begin(), others.triangles()[t].end());
        for (const Segment& border : bordersAt(others, corners)) {
          const Segment &e = ofB ? border : edge, &f = ofB ? edge : border;
          if ((m_self && (holds({border[0], border[1], border[1]}, edge[0]) ||
                          holds({border[0], border[1], border[1]}, edge[1]))) ||
              certainlyNotBetweenEnds(m_a[e[0]], m_a[e[1]], m_b[f[0]], m_b[f[1]]))
            continue;
          const oracle::Closest points =
              oracle::edgeEdge(m_a[e[0]], m_a[e[1]], m_b[f[0]], m_b[f[1]]);
          if (!points.interior || points.square == 0) continue;
          const mpf_class length = root(points.square);
          mpf_class up(0, 400);
          for (int x = 0; x < 3; ++x)
            up += outward[x] * mpf_class(points.difference[x], 400) * (ofB ? 1 : -1);
          const Answer isBelow = both(isAbove(up / size / length, 0.7, 1e-9),
                                      isAbove((depth - length) / depth, 0.0, 1e-9));
          const Answer has = both(isBeyond, isBelow);
          if (has == Answer::Yes) m_borders.edges.insert({e, f});
          if (has == Answer::Either) m_unsureBorders.edges.insert({e, f});
          if (stands != Answer::Yes && isBelow != Answer::No) stands = isBelow;
        }
      }
      (ofB ? m_beyondOfB : m_beyondOfA)[vertex] = both(isBeyond, stands);
    }
  }
  static bool isClosed(const Moving& m) {
    for (std::uint32_t v = 0; v < m.mesh.positions.size(); ++v)
      if (!at(m, v).empty() && !atBorder(m, {v}).empty()) return false;
    return true;
  }
  static std::set<Segment> bordersAt(const Moving& m, const std::set<std::uint32_t>& corners) {
    std::set<Segment> borders;
    for (const std::uint32_t corner : corners)
      for (const std::uint32_t t : at(m, corner))
        for (const std::uint32_t other : m.triangles()[t])
          if (other != corner && at(m, Segment{corner, other}).size() == 1)
            borders.insert(sorted(corner, other));
    return borders;
  }
  /// Whether contacts with borders stand for that of a vertex behind.
  Answer isBeyond(bool ofB, std::uint32_t vertex) const {
    const auto& all = ofB && !m_self ? m_beyondOfB : m_beyondOfA;
    const auto found = all.find(vertex);
    return found == all.end() ? Answer::No : found->second;
  }

  /// The contacts of edges from vertices behind, with ridges that these are below.
  void addRims(const Moving& vertices, const Moving& others, bool ofB) {
    if (ofB && m_self) return;
    for (const auto& [vertex, all] : crossingsOf(ofB)) {
      const Answer isBeyondBorder = isBeyond(ofB, vertex);
      if (isBeyondBorder == Answer::Yes) continue;
      const Vector3d& p = vertices[vertex];
      const auto [a, b, c] = others.triangles()[depthsOf(ofB).at(vertex)];
      const oracle::Closest foot = oracle::vertexTriangle(p, others[a], others[b], others[c]);
      for (const auto& [edge, triangle] : all) {
        const Vector3d& q = vertices[edge[edge[0] == vertex]];
        const Rational along = oracle::dot(foot.difference, crossing(p, q, others, triangle));
        const double share = Rational(along / foot.square + 1).get_d();  // of the vertex' depth
        if (share < 0.5 - 1e-9) continue;
        Below& below = share > 0.5 + 1e-9 && isBeyondBorder == Answer::No ? m_rims : m_unsureRims;
        using namespace oracle;
        const Vector wayOut = Rational(-1) * foot.difference;
        addRidge(others, ofB, edge, {triangle}, 1.5 * share * root(foot.square), wayOut, below);
      }
    }
  }

  Depths depths(const Moving& vertices, const Moving& others, Crossings& crossings) const {
    const auto count = static_cast<std::uint32_t>(others.triangles().size());
    std::set<Segment> edges;
    for (const Triangle& t : vertices.triangles())
      for (int i = 0; i < 3; ++i)
        edges.insert({std::min(t[i], t[(i + 1) % 3]), std::max(t[i], t[(i + 1) % 3])});
    struct Start {
      std::set<std::uint32_t> triangles;
      std::vector<oracle::Vector> crossings;  // from the vertex
    };
    std::map<std::uint32_t, Start> starts;
    for (const Segment& edge : edges) {
      std::map<std::set<std::uint32_t>, std::set<int>> sides;  // of the first end, by feature
      std::map<int, std::set<std::uint32_t>> triangles;        // by that side
      for (std::uint32_t t = 0; t < count; ++t) {
        if (!mayMeet(others, t, edge)) continue;
        const Vector3d &p = vertices[edge[0]], &q = vertices[edge[1]];
        const int first = side(others, t, p);
        if (first * side(others, t, q) >= 0) continue;
        const auto feature = crossedFeature(p, q, others, t);
        if (feature.empty()) continue;
        sides[feature].insert(first);
        triangles[first].insert(t);
      }
      int sum = 0;
      for (const auto& [feature, signs] : sides)
        sum += leavesIn(others, feature, signs, vertices[edge[0]], vertices[edge[1]]);
      if (sum == 0) continue;
      Start& start = starts[edge[sum < 0]];
      for (const std::uint32_t t : triangles[sum > 0 ? -1 : 1]) {
        crossings[edge[sum < 0]].insert({edge, t});
        start.triangles.insert(t);
        start.crossings.push_back(
            crossing(vertices[edge[sum < 0]], vertices[edge[sum > 0]], others, t));
      }
    }
    Depths depths;
    for (const auto& [vertex, start] : starts)
      depths[vertex] = shortest(vertices[vertex], vertex, others,
                                nearest(vertices[vertex], vertex, others, start.triangles),
                                start.triangles, start.crossings);
    return depths;
  }

  /// From p to where the segment from p to q crosses the plane of a triangle.
  static oracle::Vector crossing(const Vector3d& p, const Vector3d& q, const Moving& others,
                                 std::uint32_t t) {
    using namespace oracle;
    const auto& [a, b, c] = others.triangles()[t];
    const auto origin = toRational(others[a]);
    const auto normal = cross(toRational(others[b]) - origin, toRational(others[c]) - origin);
    const auto from = toRational(p), along = toRational(q) - from;
    return Rational(dot(normal, origin - from) / dot(normal, along)) * along;
  }

  /// How far the vertex and these crossings must move towards the closest point, until all are in
  /// front of it. difference: from there to the vertex.
  static mpf_class exitDistance(const oracle::Vector& difference,
                                const std::vector<oracle::Vector>& crossings) {
    Rational furthest = 0;
    for (const oracle::Vector& x : crossings)
      furthest = std::max(furthest, oracle::dot(difference, x));
    const mpf_class length = oracle::root(oracle::dot(difference, difference));
    return length + mpf_class(furthest, 400) / length;
  }

  static Rational squareToBox(const Vector3d& p, const Moving& others, std::uint32_t t) {
    const auto& [a, b, c] = others.triangles()[t];
    Rational square = 0;
    for (int i = 0; i < 3; ++i) {
      const auto [lower, upper] = std::minmax({others[a][i], others[b][i], others[c][i]});
      const Rational beyond = p[i] < lower   ? Rational(lower) - Rational(p[i])
                              : p[i] > upper ? Rational(p[i]) - Rational(upper)
                                             : Rational(0);
      square += beyond * beyond;
    }
    return square;
  }

  /// Of the feature in a triangle and all from which no neighbour is nearer, the one with the
  /// shortest exit distance; in its lowest triangle.
  std::uint32_t shortest(const Vector3d& p, std::uint32_t vertex, const Moving& others,
                         std::uint32_t triangle, const std::set<std::uint32_t>& starts,
                         const std::vector<oracle::Vector>& crossings) const {
    const auto count = static_cast<std::uint32_t>(others.triangles().size());
    const auto mayHold = [&](std::uint32_t t) {
      return !(m_self && holds(others.triangles()[t], vertex)) && side(others, t, p) < 0;
    };
    const auto exitAt = [&](std::uint32_t t) {
      const Triangle& corners = others.triangles()[t];
      const oracle::Closest found =
          oracle::vertexTriangle(p, others[corners[0]], others[corners[1]], others[corners[2]]);
      return exitDistance(found.difference, crossings);
    };
    std::vector<Place> places;
    for (std::uint32_t t = 0; t < count; ++t)
      if (mayHold(t)) places.push_back(place(p, others, t));
    // Which triangles connect with the nearest one, or one that the edges cross.
    const mpf_class reach = exitAt(triangle) * 1.5;
    std::set<std::uint32_t> inReach, reached;
    for (std::uint32_t t = 0; t < count; ++t)
      if (!(m_self && holds(others.triangles()[t], vertex)) &&
          oracle::root(squareToBox(p, others, t)) <= reach)
        inReach.insert(t);
    for (const std::uint32_t t : starts)
      if (inReach.contains(t)) reached.insert(t);
    reached.insert(triangle);
    for (std::size_t last = 0; last != reached.size();) {
      last = reached.size();
      for (const std::uint32_t t : inReach)
        for (const std::uint32_t v : others.triangles()[t])
          if (std::any_of(reached.begin(), reached.end(),
                          [&](std::uint32_t s) { return holds(others.triangles()[s], v); })) {
            reached.insert(t);
            break;
          }
    }
    const auto isLocal = [&](const Place& at) {
      return std::none_of(places.begin(), places.end(), [&](const Place& other) {
        return other.square < at.square &&
               std::all_of(at.feature.begin(), at.feature.end(), [&](std::uint32_t c) {
                 return holds(others.triangles()[other.triangle], c);
               });
      });
    };
    std::stable_sort(places.begin(), places.end(),
                     [](const Place& l, const Place& r) { return l.square < r.square; });
    mpf_class exit = exitAt(triangle);
    std::set<std::uint32_t> best = place(p, others, triangle).feature;
    for (const Place& at : places)
      if (const mpf_class other = exitAt(at.triangle); other < exit * (1.0 - kExitDistanceSlack) &&
                                                       isLocal(at) &&
                                                       reached.contains(at.triangle)) {
        exit = other;
        best = at.feature;
      }
    for (std::uint32_t t = 0; t < count; ++t)
      if (mayHold(t) && place(p, others, t).feature == best) return t;
    return triangle;
  }

  std::uint32_t nearest(const Vector3d& p, std::uint32_t vertex, const Moving& others,
                        const std::set<std::uint32_t>& starts) const {
    const auto nearestOf = [&](const std::set<std::uint32_t>& ids) {
      Place best = place(p, others, *ids.begin());
      for (const std::uint32_t t : ids)
        if (Place found = place(p, others, t); found.square < best.square) best = found;
      return best;
    };
    for (Place now = nearestOf(starts);;) {
      std::set<std::uint32_t> around{now.triangle};
      for (std::uint32_t t = 0; t < others.triangles().size(); ++t) {
        const Triangle& corners = others.triangles()[t];
        if (std::all_of(now.feature.begin(), now.feature.end(),
                        [&](std::uint32_t c) { return holds(corners, c); }) &&
            !(m_self && holds(corners, vertex)) && side(others, t, p) < 0)
          around.insert(t);
      }
      const Place next = nearestOf(around);
      if (next.square == now.square) {
        for (const std::uint32_t t : around)
          if (place(p, others, t).feature == now.feature) return t;
      }
      now = next;
    }
  }

  static int cornerOf(const Triangle& t, std::uint32_t v) {
    return t[0] == v ? 0 : t[1] == v ? 1 : 2;
  }
  static int edgeOf(const Triangle& t, const Segment& e) {
    for (int i = 0; i < 2; ++i)
      if (holds({t[i], t[i + 1], t[i]}, e)) return i;
    return 2;
  }

  Answer vertexTriangle(const Moving& vertices, const Moving& triangles, const Ids& ids) const {
    const std::uint32_t v = ids[1], t = ids[2];
    switch (m_settings.method) {
      case Method::Intersection:
        if (!isDepth(ids)) return cornerMeets(vertices, ids);
        switch (isBeyond(ids[0] != PlainContact::VertexTriangle, v)) {
          case Answer::No:
            return Answer::Yes;
          case Answer::Either:
            return Answer::Either;
          case Answer::Yes:
            return cornerMeets(vertices, ids);
        }
        return Answer::Either;
      case Method::Proximity: {
        if (m_settings.contacts == Contacts::Distinct) return distinct(vertices, triangles, ids);
        const auto positions = positionsOf(vertices, v, triangles, t);
        return within(closest(positions).square, positions);
      }
      default: {
        const auto& [a, b, c] = triangles.triangles()[t];
        return impactOf(
            false, {vertices.before[v], triangles.before[a], triangles.before[b],
                    triangles.before[c], vertices[v], triangles[a], triangles[b], triangles[c]});
      }
    }
  }

  bool isDepth(const Ids& ids) const {
    const Depths& depths = depthsOf(ids[0] != PlainContact::VertexTriangle);
    const auto found = depths.find(ids[1]);
    return found != depths.end() && found->second == ids[2];
  }
  Answer cornerMeets(const Moving& vertices, const Ids& ids) const {
    Answer answer = Answer::No;
    const std::uint32_t v = ids[1], t = ids[2];
    // A mesh with itself: the vertex may be of the pair's second triangle.
    const bool first = ids[0] == PlainContact::VertexTriangle;
    for (const std::uint32_t s : at(vertices, v)) {
      const int corner = cornerOf(vertices.triangles()[s], v);
      const Meeting meeting = first ? Meeting(*this, s, t) : Meeting(*this, t, s);
      if (!(first ? meeting.cornerOfA(corner) : meeting.cornerOfB(corner))) continue;
      if (meeting.touch) return Answer::Yes;
      const std::uint32_t ofA = first ? s : t, ofB = first ? t : s;
      if (meeting.isBehind(*this, ofA, ofB)) continue;
      const Below below = belowOf(meeting, ofA, ofB);
      if (below.unsure) answer = Answer::Either;
      if (!below.stands && !below.unsure) return Answer::Yes;
    }
    return answer;
  }

  bool holdsEither(const Below& below, const Segment& p, const Segment& q) const {
    return below.edges.contains({p, q}) || (m_self && below.edges.contains({q, p}));
  }
  Answer edges(const Segment& p, const Segment& q) const {
    switch (m_settings.method) {
      case Method::Intersection: {
        if (holdsEither(m_rims, p, q) || holdsEither(m_borders, p, q)) return Answer::Yes;
        Answer answer = m_rims.unsure || m_unsureRims.unsure || holdsEither(m_unsureRims, p, q) ||
                                holdsEither(m_unsureBorders, p, q)
                            ? Answer::Either
                            : Answer::No;
        for (const std::uint32_t s : at(m_a, p))
          for (const std::uint32_t t : at(m_b, q)) {
            const Meeting meeting(*this, s, t);
            const bool isPair =
                meeting.edgePair(edgeOf(m_a.triangles()[s], p), edgeOf(m_b.triangles()[t], q));
            if (isPair && meeting.touch) return Answer::Yes;
            if (!meeting.any || meeting.touch || meeting.isBehind(*this, s, t)) continue;
            const Below below = belowOf(meeting, s, t);
            if (holdsEither(below, p, q)) return Answer::Yes;
            if (below.unsure) answer = Answer::Either;
            if (isPair && !below.stands && !below.unsure) return Answer::Yes;
          }
        return answer;
      }
      case Method::Proximity: {
        const std::array positions{m_a[p[0]], m_a[p[1]], m_b[q[0]], m_b[q[1]]};
        const oracle::Closest points =
            oracle::edgeEdge(positions[0], positions[1], positions[2], positions[3]);
        if (m_settings.contacts == Contacts::Distinct && !points.interior) return Answer::No;
        return within(points.square, positions);
      }
      default:
        return impactOf(true, {m_a.before[p[0]], m_a.before[p[1]], m_b.before[q[0]],
                               m_b.before[q[1]], m_a[p[0]], m_a[p[1]], m_b[q[0]], m_b[q[1]]});
    }
  }

  // ---- Continuous ----

  Answer impactOf(bool edges, const palpate::impact::Positions& p) const {
    if (m_settings.thickness == 0)
      return palpate::impact::Query(edges, p).firstTouch() ? Answer::Yes : Answer::No;
    // The least distance over the step, first at samples and then between them.
    const auto distanceAt = [&](double t) {
      std::array<Vector3d, 4> x;
      for (int i = 0; i < 4; ++i) x[i] = (1 - t) * p[i] + t * p[4 + i];
      const oracle::Closest points = edges ? oracle::edgeEdge(x[0], x[1], x[2], x[3])
                                           : oracle::vertexTriangle(x[0], x[1], x[2], x[3]);
      return oracle::root(points.square).get_d();
    };
    double step = 1.0 / 64, best = 0, least = distanceAt(0);
    const auto consider = [&](double t) {
      const double distance = distanceAt(std::clamp(t, 0.0, 1.0));
      if (distance < least) best = std::clamp(t, 0.0, 1.0), least = distance;
    };
    for (int i = 1; i <= 64; ++i) consider(i * step);
    for (; step > 1e-10; step *= 0.5) {
      const double middle = best;
      consider(middle - step / 2);
      consider(middle + step / 2);
    }
    double displacement = 0, largest = 0;
    for (int i = 0; i < 4; ++i) {
      displacement = std::max(displacement, ((p[4 + i] - p[4]) - (p[i] - p[0])).norm());
      for (int end = 0; end < 8; end += 4)
        largest = std::max(largest, (p[end + i] - p[end]).cwiseAbs().maxCoeff());
    }
    const double error = TimeOfImpactSettings{}.timeTolerance * displacement +
                         0x1p-40 * (largest + m_settings.thickness);
    if (std::abs(least - m_settings.thickness) <= error) return Answer::Either;
    return least < m_settings.thickness ? Answer::Yes : Answer::No;
  }

  PairSettings m_settings;
  Moving m_a, m_b;
  bool m_self;
  Depths m_depthsOfA, m_depthsOfB;
  Crossings m_crossingsOfA, m_crossingsOfB;
  std::map<std::uint32_t, Answer> m_beyondOfA, m_beyondOfB;  ///< isBeyond()
  Below m_rims, m_unsureRims, m_borders, m_unsureBorders;
};

}  // namespace palpate::testing
