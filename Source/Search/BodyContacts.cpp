#include "Search/BodyContacts.h"

#include "Queries/Containment.h"
#include "Bodies/OctreeFrame.h"
#include "Contact/ContactLists.h"
#include "Mesh/Corners.h"
#include "Math/ClosestPoint.h"
#include "Math/RayCrossing.h"
#include "Math/StableLength.h"
#include "Math/Tolerances.h"
#include "Core/Stopping.h"

#include <algorithm>

namespace palpate {

using Eigen::Vector3d;

namespace {

/// Whether contacts of bodies may stand for those of a pair.
bool mayBeBodies(const Question& question) {
  const PairSettings& settings = question.settings();
  if (settings.method != Method::Auto || settings.continuous.earliestTimeOnly || question.self() ||
      question.plan.kind != PairKind::Meshes || question.anyDisabled() ||
      question.meshes().hasFilters())
    return false;
  return question.a.mesh.topology.count() > 0 && question.b.mesh.topology.count() > 0 &&
         hasClosedSurface(question.a) && hasClosedSurface(question.b);
}

/// Of the vertices that elements have now, in the world.
Eigen::AlignedBox3d boxOf(const Body& body) {
  Eigen::AlignedBox3d box;
  TimeCheck check(512);
  body.mesh.topology.forEachElement([&](std::uint32_t element) {
    check();
    for (const std::uint32_t v : body.mesh.topology.elements[element]) box.extend(body.mesh.now[v]);
  });
  return box;
}

/// Whether the octree's box, which may be larger than the body, has a point.
bool mayContain(const Body& body, const Vector3d& p) {
  const OctreeFrame frame(body);
  return frame.toWorld()(body.tree.octree().box(0)).overlaps(frame.boxInWorld(p));
}

std::uint32_t vertexOf(const Body& body) {
  const MeshTopology& topology = body.mesh.topology;
  return topology.elements[topology.lowest()][0];
}

/// Whether a vertex of a body was inside another one at the step's start. Tests all triangles.
bool wasInside(const Body& inner, const Body& outer, PointQueryStack& stack) {
  TimeCheck check(256);
  const auto cornersAt = [&](std::size_t i) {
    check();
    return cornersOf(outer.tree.ordered()[i], outer.mesh.before);
  };
  SignCounts counts;
  const int number = windingNumber(outer.tree.ordered().size(), cornersAt,
                                   inner.mesh.before[vertexOf(inner)], counts);
  stack.exactDecisions += counts.undecided;
  return number != 0;
}

/// Whether a vertex of a body whose box is in that of another one is inside it, at both ends of the
/// step.
bool isInside(const Body& inner, const Body& outer, Engine engine, PointQueryStack& stack) {
  const Vector3d& p = inner.mesh.now[vertexOf(inner)];
  return mayContain(outer, p) && windingNumber(outer, p, engine, stack) != 0 &&
         boxOf(outer).contains(boxOf(inner)) && wasInside(inner, outer, stack);
}

/// Calls f(normal along which the contact pushes a, whether it is of edges).
template <class F>
void forEachPush(std::span<ContactBuffers* const> local, F&& f) {
  for (const ContactBuffers* buffers : local) {
    forEachMeshList(*buffers, [&](ContactKind kind, const auto& list) {
      const bool swapped = kind == ContactKind::TriangleVertex;
      for (const auto& contact : list)
        f(swapped ? Vector3d(-contact.normal) : contact.normal, kind == ContactKind::EdgeEdge);
    });
  }
}

/// Cosine of the angle within which all contacts push if they push to one side.
constexpr double kSameSide = 0.5;

/// Whether all contacts push to where vertices do. They then separate the bodies.
bool agree(std::span<ContactBuffers* const> local) {
  TimeCheck check(512);
  Vector3d sum = Vector3d::Zero();
  forEachPush(local, [&](const Vector3d& normal, bool ofEdges) {
    check();
    if (!ofEdges) sum += normal;
  });
  bool all = sum != Vector3d::Zero();
  const double least = kSameSide * stableLength(sum);
  forEachPush(local, [&](const Vector3d& normal, bool) {
    check();
    all &= normal.dot(sum) >= least;
  });
  return all;
}

bool anyIntersecting(std::span<ContactBuffers* const> local) {
  return std::any_of(local.begin(), local.end(), [](const ContactBuffers* buffers) {
    return !buffers->intersectingTriangles.empty();
  });
}

/// The sum of the normals of the triangles at an edge.
Vector3d normalOfEdge(const TriangleMesh& mesh, const Segment& edge) {
  Vector3d sum = Vector3d::Zero();
  const std::uint32_t id = mesh.topology.edgeOf(edge);
  for (const std::uint32_t t : mesh.topology.edgeTriangles[id]) {
    const auto [p, q, r] = cornersOf(mesh.topology.elements[t], mesh.now);
    sum += windingNormal(p, q, r);
  }
  return sum;
}

/// Whether an impact's normal is that of a feature which leaves a body.
bool leaves(const TriangleMesh& body, const VertexTriangleContact& c) {
  const auto [p, q, r] = cornersOf(c.vertices, body.now);
  return c.normal.dot(windingNormal(p, q, r)) < 0;
}
bool leaves(const TriangleMesh& a, const TriangleMesh& b, const EdgeEdgeContact& c) {
  return c.normal.dot(normalOfEdge(b, c.edgeB)) < 0 || c.normal.dot(normalOfEdge(a, c.edgeA)) > 0;
}
/// Calls f(impact) for impacts of features that leave a body, until it returns true.
template <class F>
bool anyLeaving(const TriangleMesh& a, const TriangleMesh& b, BodyContacts::Buffers step, F&& f) {
  TimeCheck check(128);
  bool any = false;
  for (ContactBuffers* found : step)
    forEachMeshList(*found, [&](auto kind, auto& list) {
      any = any || std::any_of(list.begin(), list.end(), [&](auto& contact) {
              check();
              if (!(contact.timeOfImpact < 1.0)) return false;
              if constexpr (kind == ContactKind::EdgeEdge)
                return leaves(a, b, contact) && f(contact);
              else
                return leaves(kind == ContactKind::VertexTriangle ? b : a, contact) && f(contact);
            });
    });
  return any;
}

bool anyLeaves(const TriangleMesh& a, const TriangleMesh& b, BodyContacts::Buffers step) {
  return anyLeaving(a, b, step, [](const auto&) { return true; });
}

/// Turns these impacts, so that they push the feature on out. Returns whether there were any.
bool turnLeaving(const TriangleMesh& a, const TriangleMesh& b, BodyContacts::Buffers step) {
  bool any = false;
  anyLeaving(a, b, step, [&](auto& contact) {
    turn(contact);
    any = true;
    return false;
  });
  return any;
}

}  // namespace

bool BodyContacts::find(const Question& question, Engine engine, bool startsIntersecting,
                        Buffers local, Buffers step) {
  PointQueryStack& stack = m_scratch.pair.stack;
  m_hasTurned = false;
  stack.exactDecisions = 0;
  m_contacts.clear();
  if (!mayBeBodies(question)) return false;
  const Body &a = question.a, &b = question.b;
  const bool meet = anyIntersecting(local);
  if (meet && agree(local)) return false;
  const bool overlapped =
      startsIntersecting || meet || isInside(a, b, engine, stack) ||
      isInside(b, a, engine, stack) ||
      (anyLeaves(a.mesh, b.mesh, step) && (wasInside(a, b, stack) || wasInside(b, a, stack)));
  if (!overlapped) return false;
  const BodyPair pair(a, b, engine, m_scratch.pair, kQuick.moved);
  const Penetration found = penetrationOf(pair, m_scratch, kQuick);
  if (found.intersecting) addContacts(pair, found, question.settings().thickness, local);
  if (!found.intersecting && !meet) m_hasTurned = turnLeaving(a.mesh, b.mesh, step);
  return found.intersecting;
}

void BodyContacts::addContacts(const BodyPair& pair, const Penetration& found, double thickness,
                               Buffers local) {
  auto& triangles = m_contacts.intersectingTriangles;
  for (const ContactBuffers* buffers : local)
    triangles.insert(triangles.end(), buffers->intersectingTriangles.begin(),
                     buffers->intersectingTriangles.end());
  // Intersection did not run if the surfaces were apart at the start.
  if (triangles.empty())
    for (const BodyPair::IntersectingTriangles& both : m_scratch.intersecting)
      triangles.push_back({both.elementA, both.elementB});
  for (const bool ofA : {true, false}) addVertices(pair, ofA, found, thickness);
  addEdges(found);
}

/// Each vertex that passes the other surface on the way out, where it passes it last; and each that
/// has passed it by the thickness at most, so that it stays there.
void BodyContacts::addVertices(const BodyPair& pair, bool ofA, const Penetration& penetration,
                               double thickness) {
  const BodyVertices& own = pair.vertices(ofA);
  const Vector3d direction = ofA ? penetration.direction : Vector3d(-penetration.direction);
  // The last of them passes at the depth, within rounding.
  const double end = penetration.depth + kExitSlack * pair.magnitude();
  for (std::uint32_t v = 0; v < own.positions.size(); ++v) {
    if (own.triangleOf[v] == kNoElement) continue;
    checkTime();
    const auto exit = pair.lastExitOf({ofA, v}, direction, -thickness, end);
    if (!exit) continue;
    const Triangle& corners = pair.geometry(!ofA).mesh.topology.elements[exit->element];
    const auto [p, q, r] = cornersOf(corners, pair.vertices(!ofA).positions);
    const VertexTriangleDistance at =
        finiteVertexTriangleDistance(own.positions[v] + exit->distance * direction, p, q, r);
    m_scratch.pair.stack.exactDecisions += at.exact;
    auto& list = ofA ? m_contacts.vertexTriangle : m_contacts.triangleVertex;
    list.push_back(
        {v, exit->element, corners, at.weights, direction, -exit->distance, 1.0, at.feature});
  }
}

/// The edges that meet last, if edges do. Vertices alone would leave the bodies where they cross.
void BodyContacts::addEdges(const Penetration& penetration) {
  struct Edge {
    std::array<std::uint32_t, 2> vertices;
    double weight;  ///< of the second vertex
  };
  const auto edgeOf = [](const SurfacePoint& point) {
    int least = 0;
    point.weights.minCoeff(&least);
    const int i = (least + 1) % 3, j = (least + 2) % 3;
    const std::uint32_t p = point.vertices[static_cast<std::size_t>(i)],
                        q = point.vertices[static_cast<std::size_t>(j)];
    return p < q ? Edge{{p, q}, point.weights[j]} : Edge{{q, p}, point.weights[i]};
  };
  const auto isOnEdge = [](const SurfacePoint& point) {
    return (point.weights.array() > kExitWeight).count() == 2;
  };
  if (!isOnEdge(penetration.a) || !isOnEdge(penetration.b)) return;
  const Edge a = edgeOf(penetration.a), b = edgeOf(penetration.b);
  m_contacts.edgeEdge.push_back({a.vertices, b.vertices, a.weight, b.weight, penetration.direction,
                                 -penetration.depth, 1.0, EdgeFeature::Interior,
                                 EdgeFeature::Interior});
}

}  // namespace palpate
