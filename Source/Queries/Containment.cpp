#include "Queries/Containment.h"

#include <palpate/Error.h>

#include "Queries/Embedding.h"
#include "Queries/OuterSurface.h"
#include "Queries/PointDistances.h"
#include "Math/RayCrossing.h"
#include "Math/StableLength.h"
#include "Math/Tolerances.h"
#include "Core/Assert.h"
#include "Core/Text.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <optional>

namespace palpate {

namespace {

constexpr float kFloatInfinity = std::numeric_limits<float>::infinity();

/// Point queries for one body.
class BodyQuery {
 public:
  BodyQuery(const Body& geometry, Engine engine, PointQueryStack& stack)
      : m_geometry(geometry),
        m_bruteForce(engine == Engine::BruteForce),
        m_stack(stack),
        m_frame(geometry) {}

  /// The winding number of the surface about p; none on the surface. Counted along the axis, or
  /// against it, that leaves the octree first.
  std::optional<int> windingNumber(const Eigen::Vector3d& p) {
    FloatBox ray = m_frame.boxOf(p);
    int axis = 0;
    bool against = false;
    if (!m_bruteForce) {
      const FloatBox root = m_frame.map()(m_geometry.tree.octree().box(0));
      if (!ray.overlaps(root)) return 0;
      // The bits of floats that are not negative have the order of the floats.
      std::uint32_t least = ~0u;
      for (std::uint32_t k = 0; k < 3; ++k) {
        const auto key = [](float way, std::uint32_t direction) {
          return (std::bit_cast<std::uint32_t>(std::max(way, 0.0f)) & ~7u) | direction;
        };
        least = std::min({least, key(root.upper[k] - ray.upper[k], k),
                          key(ray.lower[k] - root.lower[k], k + 4)});
      }
      axis = static_cast<int>(least & 3);
      against = (least & 4) != 0;
      (against ? ray.lower : ray.upper)[axis] = against ? -kFloatInfinity : kFloatInfinity;
    }
    int number = 0;
    bool on = false;
    SignCounts counts;
    const auto count = [&](std::uint32_t i) {
      const auto& [a, b, c] = m_geometry.tree.ordered()[i];
      const auto& now = m_geometry.mesh.now;
      const RayCrossing crossing = crossRay(axis, against, p, now[a], now[b], now[c], counts);
      if (crossing == RayCrossing::OnTriangle)
        on = true;
      else
        number += static_cast<int>(crossing);
    };
    if (m_bruteForce) {
      for (std::uint32_t i = 0; i < size(); ++i) count(i);
    } else {
      findOverlapping(m_geometry.tree.octree(), m_frame.map(), ray, m_stack);
      for (const std::uint32_t i : m_stack.found) count(i);
    }
    m_stack.exactDecisions += counts.undecided;
    return on ? std::nullopt : std::optional(number);
  }

  /// The nearest point of the surface. If several triangles are equally near, on the lowest. Of a
  /// closed surface, the nearest point of its outer surface.
  InsideVertex nearest(std::uint32_t vertex, const Eigen::Vector3d& p, const OuterSurface& outer) {
    const PointDistances distances(m_geometry, p, m_bruteForce);
    const auto near = distances.nearest(kInfinity, m_last);
    PALPATE_ASSERT(near);
    m_last = near->place;
    const InsideVertex result{vertex,
                              near->element,
                              m_geometry.tree.ordered()[near->place],
                              near->closest.weights,
                              -near->closest.normal,
                              near->closest.distance,
                              true};
    if (!m_geometry.isKnownClosed() || !(result.depth > 0)) return result;
    const int number = windingNumber(p).value_or(0);
    const auto numberAt = [this](const Eigen::Vector3d& q) { return windingNumber(q); };
    if (number == 0 || outer.holds(p, *near, number, numberAt)) return result;
    const auto way = outer.nearest(p, number, numberAt);
    if (!way) return result;
    const Triangle& corners = m_geometry.mesh.topology.elements[way->element];
    const Positions& now = m_geometry.mesh.now;
    const double depth = stableLength(way->point - p);
    return {vertex,
            way->element,
            corners,
            vertexTriangleDistance(way->point, now[corners[0]], now[corners[1]], now[corners[2]])
                .weights,
            (way->point - p).stableNormalized(),
            depth,
            true};
  }

 private:
  std::uint32_t size() const {
    return static_cast<std::uint32_t>(m_geometry.tree.ordered().size());
  }

  const Body& m_geometry;
  bool m_bruteForce;
  PointQueryStack& m_stack;
  PointFrame m_frame;
  std::uint32_t m_last = 0;  ///< the triangle nearest to the last point: often near the next one
};

/// Whether points are inside a body, and their surface points.
class InsideQuery {
 public:
  InsideQuery(const Body& body, const InsideSettings& settings, Engine engine,
              PointQueryStack& stack)
      : m_body(body),
        m_settings(settings),
        m_bruteForce(engine == Engine::BruteForce),
        m_surface(body, engine, stack) {
    if (body.solid) m_solid.emplace(body, engine, stack);
  }

  WindingNumbers::Result evaluate(const Eigen::Vector3d& p) {
    if (m_settings.rule == InsideRule::WindingNumber) {
      const WindingNumbers::Result found =
          m_body.prepared->windingNumbers.evaluate(m_body, p, m_settings.margin, m_bruteForce);
      // That of a closed surface is an integer, which is exact where rounding leaves the sum open.
      if (found.decided || !m_body.isKnownClosed()) return found;
      return {m_surface.windingNumber(p).value_or(0) != 0, true};
    }
    if (m_solid) return {m_solid->lowest(p).has_value(), true};
    return {m_surface.windingNumber(p).value_or(0) != 0, true};
  }
  InsideVertex nearest(std::uint32_t vertex, const Eigen::Vector3d& p, const OuterSurface& outer) {
    return m_surface.nearest(vertex, p, outer);
  }

 private:
  const Body& m_body;
  const InsideSettings& m_settings;
  const bool m_bruteForce;
  BodyQuery m_surface;
  std::optional<SolidQuery> m_solid;
};

}  // namespace

bool isInside(const Body& body, const Eigen::Vector3d& point, const InsideSettings& settings,
              Engine engine, PointQueryStack& stack) {
  return body.tree.octree().size() > 0 &&
         InsideQuery(body, settings, engine, stack).evaluate(point).inside;
}

int windingNumber(const Body& body, const Eigen::Vector3d& point, Engine engine,
                  PointQueryStack& stack) {
  if (body.tree.octree().size() == 0) return 0;
  return BodyQuery(body, engine, stack).windingNumber(point).value_or(0);
}

void findInside(const Body& vertices, const Body& body, const InsideSettings& settings,
                Engine engine, const Threads& threads, VertexSearch<InsideVertex>& scratch,
                std::vector<InsideVertex>& out) {
  PALPATE_ASSERT(body.tree.isValid());
  if (body.tree.octree().size() == 0) return out.clear();
  const OuterSurface outer(body, engine == Engine::BruteForce);
  searchVertices(vertices.mesh.topology, threads, scratch, out, [&](PointQueryStack& stack) {
    return [&, query = InsideQuery(body, settings, engine, stack)](
               std::uint32_t v) mutable -> std::optional<InsideVertex> {
      const Eigen::Vector3d& p = vertices.mesh.now[v];
      const WindingNumbers::Result result = query.evaluate(p);
      if (!result.inside) return {};
      InsideVertex inside = query.nearest(v, p, outer);
      inside.decided = result.decided;
      if (!(inside.depth > 0)) return {};
      return inside;
    };
  });
}

bool isClosed(const Body& body) {
  const bool hasClosed = hasClosedSurface(body);  // remembered for BodyQuery
  return body.solid || hasClosed;                 // tetrahedra define their inside
}

bool hasClosedSurface(const Body& body) {
  const MeshTopology& topology = body.mesh.topology;
  if (!topology.hasFaces()) return false;
  PreparedData& prepared = *body.prepared;
  if (!prepared.closedVersion.isCurrent(body.revisions.elements.topology)) {
    prepared.closedVersion.invalidate();
    // Bodies made for queries alone have no edges, and triangles without area may have one edge.
    bool isPlain = !topology.edges.empty() && topology.disabled.empty();
    topology.forEachElement([&](std::uint32_t i) {
      const auto& [a, b, c] = topology.elements[i];
      isPlain = isPlain && a != b && b != c && c != a;
    });
    prepared.isClosed =
        isPlain ? topology.hasOnlyClosedStars() : findMeshDefects(topology.elements).closed();
    prepared.closedVersion.commit(body.revisions.elements.topology);
  }
  return prepared.isClosed;
}

void checkSettings(const Body& body, const InsideSettings& settings) {
  if (settings.rule != InsideRule::Closed && settings.rule != InsideRule::WindingNumber)
    throw Error(ErrorCode::InvalidSettings,
                nameOf(body) + ": rule is " + std::to_string(static_cast<int>(settings.rule)) +
                    "; it must be Closed or WindingNumber",
                body.id);
  if (!(settings.margin >= 0.0 && settings.margin < 0.5))
    throw Error(ErrorCode::InvalidSettings,
                nameOf(body) + ": margin is " + textOf(settings.margin) +
                    "; it must be at least 0 and below 0.5",
                body.id);
}

void checkInside(const Body& body, InsideRule rule) {
  const MeshTopology& topology = body.mesh.topology;
  if (!topology.hasFaces())
    throw Error(ErrorCode::NotClosed,
                nameOf(body) + " is " + nameOf(topology.type) + ", which has no inside", body.id);
  if (rule == InsideRule::WindingNumber) {
    hasClosedSurface(body);  // remembered for evaluate()
    return;
  }
  if (isClosed(body)) return;
  const MeshDefects defects = findMeshDefects(topology.elements);
  const auto describe = [](const std::vector<Segment>& edges, const char* what) {
    if (edges.empty()) return std::string();
    return "; " + std::to_string(edges.size()) + " edges " + what + ", the first is (" +
           std::to_string(edges[0][0]) + ", " + std::to_string(edges[0][1]) + ")";
  };
  throw Error(ErrorCode::NotClosed,
              nameOf(body) + " has no inside: it is not closed and consistently oriented" +
                  describe(defects.open, "belong to one triangle only") +
                  describe(defects.flipped, "have the same direction in both of their triangles") +
                  describe(defects.shared, "belong to three triangles or more") +
                  (defects.unwelded ? "; no two triangles share a vertex, as in an STL file, until "
                                      "weld() joins equal positions"
                                    : ""),
              body.id);
}

}  // namespace palpate
