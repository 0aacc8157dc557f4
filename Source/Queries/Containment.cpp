#include "Queries/Containment.h"

#include <palpate/Error.h>

#include "Queries/Embedding.h"
#include "Core/Text.h"
#include "Math/ClosestPoint.h"
#include "Math/RayCrossing.h"
#include "Math/Tolerances.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

namespace palpate {

namespace {

constexpr float kFloatInfinity = std::numeric_limits<float>::infinity();

/// Whether a triangle is certainly further from p than `distance`, and so is its rounded distance.
/// Along any direction, here towards the mean of the corners, no point of the triangle is nearer
/// than its nearest corner. Errors: distances at most 2^-48 of the furthest corner's distance,
/// u . w at most 2^-50 of |u| |w|.
bool isBeyond(const Eigen::Vector3d& p, const Eigen::Vector3d& a, const Eigen::Vector3d& b,
              const Eigen::Vector3d& c, double distance) {
  const Eigen::Vector3d u = a - p, v = b - p, t = c - p, w = u + v + t;
  const double most = std::max({u.squaredNorm(), v.squaredNorm(), t.squaredNorm()});
  const double along = std::min({u.dot(w), v.dot(w), t.dot(w)}), square = w.squaredNorm();
  return along > 0 &&
         along * along * (1 - kNearestError) >
             square * (distance * distance + 2 * kNearestSlack * distance * std::sqrt(most) +
                       kNearestSlack * kNearestSlack * most);
}

/// Point queries for one body.
class BodyQuery {
 public:
  BodyQuery(const SearchableGeometry& geometry, Engine engine, PointQueryStack& stack)
      : m_geometry(geometry),
        m_bruteForce(engine == Engine::BruteForce),
        m_stack(stack),
        m_frame(geometry) {}

  /// The winding number of the surface about p; 0 on the surface.
  int windingNumber(const Eigen::Vector3d& p) {
    int number = 0;
    bool on = false;
    SignCounts counts;
    const auto count = [&](std::uint32_t i) {
      const auto& [a, b, c] = m_geometry.tree.ordered()[i];
      const auto& now = m_geometry.mesh.now;
      const RayCrossing crossing = crossRay(p, now[a], now[b], now[c], counts);
      if (crossing == RayCrossing::OnTriangle)
        on = true;
      else
        number += static_cast<int>(crossing);
    };
    if (m_bruteForce) {
      for (std::uint32_t i = 0; i < size(); ++i) count(i);
    } else {
      FloatBox ray = m_frame.boxOf(p);
      ray.upper[0] = kFloatInfinity;
      findOverlapping(m_geometry.tree.octree(), m_frame.map(), ray, m_stack);
      for (const std::uint32_t i : m_stack.found) count(i);
    }
    return on ? 0 : number;
  }

  /// The nearest point of the surface. If several triangles are equally near, on the lowest.
  InsideVertex nearest(std::uint32_t vertex, const Eigen::Vector3d& p) {
    VertexTriangleDistance best{Eigen::Vector3d::Zero(),  Eigen::Vector3d::Zero(),
                                Eigen::Vector3d::Zero(),  std::numeric_limits<double>::infinity(),
                                TriangleFeature::CornerA, false};
    std::uint32_t at = 0, id = 0xffffffffu;
    const auto testOne = [&](std::uint32_t i) {
      const auto& [a, b, c] = m_geometry.tree.ordered()[i];
      const auto& now = m_geometry.mesh.now;
      if (!m_bruteForce && isBeyond(p, now[a], now[b], now[c], best.distance)) return;
      const VertexTriangleDistance distance =
          finiteVertexTriangleDistance(p, now[a], now[b], now[c]);
      const std::uint32_t own = m_geometry.tree.octree().order()[i];
      if (distance.distance > best.distance || (distance.distance == best.distance && own > id))
        return;
      best = distance;
      at = i;
      id = own;
    };
    if (m_bruteForce) {
      for (std::uint32_t i = 0; i < size(); ++i) testOne(i);
    } else {
      // A little more than the best distance squared: distances are rounded, and the search must
      // also find equally near triangles.
      const auto bound = [&] {
        const double distance = best.distance * m_geometry.tree.frame().scale;
        return distance * distance * (1 + kNearestError);
      };
      testOne(std::min(m_last, size() - 1));
      forEachNearest(m_geometry.tree.octree(), m_frame.map(), m_frame.boxOf(p), bound(), m_stack,
                     [&](std::uint32_t i) {
                       testOne(i);
                       return bound();
                     });
      m_last = at;
    }
    return {vertex,        id,  m_geometry.tree.ordered()[at], best.barycentric, -best.normal,
            best.distance, true};
  }

  bool mayContain(const Eigen::Vector3d& p) const {
    return m_bruteForce ||
           m_frame.boxOf(p).overlaps(m_frame.map()(m_geometry.tree.octree().box(0)));
  }

 private:
  std::uint32_t size() const {
    return static_cast<std::uint32_t>(m_geometry.tree.ordered().size());
  }

  const SearchableGeometry& m_geometry;
  bool m_bruteForce;
  PointQueryStack& m_stack;
  PointFrame m_frame;
  std::uint32_t m_last = 0;  ///< the triangle nearest to the last point: often near the next one
};

}  // namespace

void findInside(const SearchableGeometry& vertices, const SearchableGeometry& body,
                const InsideSettings& settings, Engine engine, const Threads& threads,
                VertexSearch<InsideVertex>& scratch, std::vector<InsideVertex>& out) {
  if (body.tree.octree().size() == 0) return out.clear();
  const bool closed = settings.rule == InsideRule::Closed,
             bruteForce = engine == Engine::BruteForce;
  searchVertices(vertices.mesh.topology, threads, scratch, out, [&](PointQueryStack& stack) {
    return [&, bodyQuery = BodyQuery(body, engine, stack),
            solidQuery = SolidQuery(body, engine, stack)](
               std::uint32_t v) mutable -> std::optional<InsideVertex> {
      const Eigen::Vector3d& p = vertices.mesh.now[v];
      const auto isInside = [&] {
        return body.solid ? solidQuery.lowest(p).has_value()
                          : bodyQuery.mayContain(p) && bodyQuery.windingNumber(p) != 0;
      };
      const WindingNumbers::Result result =
          closed ? WindingNumbers::Result{isInside(), true}
                 : body.windingNumbers.evaluate(body, p, settings.margin, bruteForce, stack);
      if (!result.inside) return {};
      InsideVertex inside = bodyQuery.nearest(v, p);
      inside.decided = result.decided;
      if (!(inside.depth > 0)) return {};
      return inside;
    };
  });
}

void checkInside(SearchableGeometry& body, const InsideSettings& settings) {
  if (settings.rule != InsideRule::Closed && settings.rule != InsideRule::WindingNumber)
    throw Error(ErrorCode::InvalidSettings,
                nameOf(body.id) + ": rule is " + std::to_string(static_cast<int>(settings.rule)) +
                    "; it must be Closed or WindingNumber",
                body.id);
  if (!(settings.margin >= 0.0 && settings.margin < 0.5))
    throw Error(ErrorCode::InvalidSettings,
                nameOf(body.id) + ": margin is " + textOf(settings.margin) +
                    "; it must be at least 0 and below 0.5",
                body.id);
  MeshTopology& topology = body.mesh.topology;
  if (!topology.hasFaces())
    throw Error(ErrorCode::NotClosed,
                nameOf(body.id) + " is " + nameOf(topology.type) + ", which has no inside",
                body.id);
  if (settings.rule == InsideRule::WindingNumber) return;
  if (body.solid) return;  // its tetrahedra define its inside
  if (!topology.closed) topology.closed = findMeshDefects(topology.triangles).closed();
  if (*topology.closed) return;
  const MeshDefects defects = findMeshDefects(topology.triangles);
  const auto describe = [](const std::vector<Segment>& edges, const char* what) {
    if (edges.empty()) return std::string();
    return "; " + std::to_string(edges.size()) + " edges " + what + ", the first is (" +
           std::to_string(edges[0][0]) + ", " + std::to_string(edges[0][1]) + ")";
  };
  throw Error(ErrorCode::NotClosed,
              nameOf(body.id) + " has no inside: it is not closed and consistently oriented" +
                  describe(defects.open, "belong to one triangle only") +
                  describe(defects.flipped, "have the same direction in both of their triangles") +
                  describe(defects.shared, "belong to three triangles or more"),
              body.id);
}

}  // namespace palpate
