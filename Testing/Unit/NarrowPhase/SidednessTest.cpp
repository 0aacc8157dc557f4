#include <palpate/OctreeBasedCD.h>

#include "Common/QueryCalls.h"
#include "Common/ContactRows.h"
#include "Common/PairRun.h"
#include "Common/RandomMeshes.h"
#include "Common/Sanitized.h"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <vector>

// Sidedness::Outer against the exact winding number of findInsideVertices(). A contact points
// inward if a short way along its direction is inside the body.

namespace palpate::testing {
namespace {

using Eigen::Vector3d;
using Positions = std::vector<Vector3d>;

/// Closed, with spikes and pits: sharp edges and corners of either sense.
Mesh burr(Random& random) {
  Mesh body = sphere(7, 10, {0, 0, 0}, 1);
  for (Vector3d& p : body.positions) p *= uniform(random, 0.35, 1.0);
  return body;
}

/// Which of the positions are inside the body.
std::vector<bool> areInside(const Mesh& body, const Positions& places) {
  OctreeBasedCD detection(settingsOf(Engine::Octree));
  const GeometryId probes = detection.addPointSet(places), id = addMesh(detection, body);
  std::vector<bool> inside(places.size());
  for (const InsideVertex& v : testing::insideVertices(detection, probes, id))
    inside[v.vertex] = true;
  return inside;
}

Vector3d normalOf(const Mesh& mesh, std::uint32_t t) {
  const auto& [a, b, c] = mesh.triangles[t];
  return (mesh.positions[b] - mesh.positions[a])
      .cross(mesh.positions[c] - mesh.positions[a])
      .normalized();
}

/// Whether a direction is so near to the plane of a triangle that a probe cannot decide.
bool isAlongSurface(const Mesh& body, const std::set<std::uint32_t>& vertices, const Vector3d& d) {
  for (std::uint32_t t = 0; t < body.triangles.size(); ++t) {
    const auto& corners = body.triangles[t];
    std::size_t held = 0;
    for (const std::uint32_t v : corners) held += vertices.contains(v);
    if (held == vertices.size() && std::abs(normalOf(body, t).dot(d)) < 1e-3) return true;
  }
  return false;
}

/// The part of a contact that belongs to the body: position, direction, and vertices.
struct Touch {
  Row row;
  Vector3d place, direction;
  std::set<std::uint32_t> vertices;
};

Touch touchOf(const VertexTriangleContact& c, const Mesh& body) {
  Touch touch{rowOf<true>(c), Vector3d::Zero(), c.normal, {}};
  for (int i = 0; i < 3; ++i) {
    touch.place += c.weights[i] * body.positions[c.vertices[i]];
    if (c.weights[i] > 0) touch.vertices.insert(c.vertices[i]);
  }
  return touch;
}

Touch touchOf(const EdgeEdgeContact& c, const Mesh& body) {
  const auto& [p, q] = c.edgeA;
  Touch touch{
      rowOf(c), (1 - c.weightA) * body.positions[p] + c.weightA * body.positions[q], -c.normal, {}};
  if (c.weightA < 1) touch.vertices.insert(p);
  if (c.weightA > 0) touch.vertices.insert(q);
  return touch;
}

/// The rows that point outward, where a probe can decide. The others are as in `found`.
std::vector<Row> outward(const Mesh& body, const std::vector<Touch>& touches, bool corners,
                         const std::vector<Row>& found, std::size_t& told) {
  Positions probes;
  for (const Touch& t : touches) probes.push_back(t.place + 1e-7 * t.direction);
  const std::vector<bool> inside = areInside(body, probes);
  std::vector<Row> rows;
  for (std::size_t i = 0; i < touches.size(); ++i) {
    const Touch& t = touches[i];
    const bool known =
        (corners || t.vertices.size() > 1) && !isAlongSurface(body, t.vertices, t.direction);
    told += known;
    if (known ? !inside[i] : std::find(found.begin(), found.end(), t.row) != found.end())
      rows.push_back(t.row);
  }
  return rows;
}

/// The tip of a body touches a triangle whose normal points away from the body, or an edge that
/// lies on one of its edges: contacts without a distance have no side.
TEST(Sidedness, TouchingFeaturesAreKept) {
  const Positions tip{{0, 0, 0}, {-1, -1, -2}, {1, -1, -2}, {0, 1, -2}},
      plate{{-3, -3, 0}, {3, -3, 0}, {0, 3, 0}};
  const std::vector<Triangle> faces{{0, 1, 2}, {0, 2, 3}, {0, 3, 1}, {1, 3, 2}};
  for (const bool turned : {false, true})
    for (const bool swapped : {false, true}) {
      OctreeBasedCD detection(settingsOf(Engine::Octree));
      const std::vector<Triangle> face{turned ? Triangle{0, 2, 1} : Triangle{0, 1, 2}};
      const GeometryId first =
                           detection.addTriangleMesh(swapped ? plate : tip, swapped ? face : faces),
                       second =
                           detection.addTriangleMesh(swapped ? tip : plate, swapped ? faces : face),
                       body = swapped ? second : first;
      detection.addCollisionPair(first, second, {.method = Method::Proximity, .thickness = 0.5});
      detection.setCollisionFilter(body, {1, 1, Sidedness::Outer});
      detection.detectCollision();
      const CollisionData& data = detection.collisionData(first, second);
      const auto& contacts = swapped ? data.triangleVertex() : data.vertexTriangle();
      ASSERT_EQ(contacts.size(), 1u) << turned << swapped;
      EXPECT_EQ(contacts[0].distance, 0.0);
    }
}

struct SidedTool {
  Positions before, now;
  std::vector<Segment> segments;  ///< none: points
};

CollisionData answer(const Mesh& body, const SidedTool& tool, const PairSettings& pair,
                     Sidedness sidedness) {
  OctreeBasedCD detection(settingsOf(Engine::Octree));
  const GeometryId id = addMesh(detection, body),
                   other = tool.segments.empty()
                               ? detection.addPointSet(tool.before)
                               : detection.addLineMesh(tool.before, tool.segments);
  detection.addCollisionPair(id, other, pair);
  detection.setCollisionFilter(id, {1, 1, sidedness});
  detection.setPositions(other, tool.before, tool.now);
  detection.detectCollision();
  return detection.collisionData(id, other);
}

/// corners: whether the definition decides contacts whose closest point is a corner.
void expectOutward(const Mesh& body, const SidedTool& tool, const PairSettings& pair, bool corners,
                   std::size_t& told) {
  const CollisionData all = answer(body, tool, pair, Sidedness::Both);
  const Rows truth(answer(body, tool, pair, Sidedness::Outer));
  std::vector<Touch> faces, edges;
  for (const auto& c : all.triangleVertex()) faces.push_back(touchOf(c, body));
  for (const auto& c : all.edgeEdge()) edges.push_back(touchOf(c, body));
  EXPECT_EQ(firstDifference(truth.triangleVertex,
                            outward(body, faces, corners, truth.triangleVertex, told)),
            "");
  const std::vector<Row> kept = outward(body, edges, false, truth.edgeEdge, told);
  if (pair.contacts == Contacts::All || tool.segments.empty()) {
    EXPECT_EQ(firstDifference(truth.edgeEdge, kept), "");
  } else {
    // A contact that is refused excludes no other, so that more of All's may be reported.
    PairSettings every = pair;
    every.contacts = Contacts::All;
    edges.clear();
    const CollisionData everything = answer(body, tool, every, Sidedness::Both);
    for (const auto& c : everything.edgeEdge()) edges.push_back(touchOf(c, body));
    const std::vector<Row> possible = outward(body, edges, false, truth.edgeEdge, told);
    const auto contains = [](const std::vector<Row>& whole, const std::vector<Row>& some) {
      return std::includes(whole.begin(), whole.end(), some.begin(), some.end());
    };
    EXPECT_TRUE(contains(truth.edgeEdge, kept) && contains(possible, truth.edgeEdge));
    EXPECT_LT(truth.edgeEdge.size(), possible.size());
  }
}

SidedTool toolOf(Random& random, std::uint32_t size, double step, bool lines) {
  SidedTool tool;
  for (std::uint32_t i = 0; i < size; ++i) {
    tool.before.push_back(randomPoint(random, -1, 1));
    tool.now.push_back(tool.before.back() + randomPoint(random, -step, step));
    if (lines && i % 2) tool.segments.push_back({i - 1, i});
  }
  return tool;
}

TEST(Sidedness, OuterReportsContactsOutsideOnly) {
  Random random(1);
  std::size_t told = 0;
  for (int run = 0; run < casesOf(12); ++run) {
    const Mesh body = burr(random);
    for (const bool lines : {false, true}) {
      const SidedTool still = toolOf(random, 150, 0.0, lines),
                      moving = toolOf(random, 60, 0.4, lines);
      expectOutward(body, still, {Method::Proximity, 0.1, Contacts::Distinct}, true, told);
      expectOutward(body, still, {Method::Proximity, 0.1, Contacts::All}, false, told);
      expectOutward(body, moving, {Method::Continuous, 0.0, Contacts::All}, false, told);
      expectOutward(body, moving, {Method::Continuous, 0.02, Contacts::All}, false, told);
    }
  }
  EXPECT_GE(told, leastOf(3000));
}

/// Ids of every contact.
std::set<Row> idsOf(const Rows& rows) {
  std::set<Row> ids;
  for (const Row& r : rows.vertexTriangle) ids.insert({0, r[0], r[1]});
  for (const Row& r : rows.triangleVertex) ids.insert({1, r[0], r[1]});
  for (const Row& r : rows.edgeEdge) ids.insert({2, r[0], r[1], r[2], r[3]});
  return ids;
}

/// With triangles added that have no area, the contacts of the others stay.
TEST(Sidedness, TrianglesWithoutAreaHaveNoSides) {
  Random random(5);
  std::size_t contacts = 0;
  for (int run = 0; run < casesOf(8); ++run) {
    const Mesh body = burr(random);
    const auto count = static_cast<std::uint32_t>(body.triangles.size());
    Mesh more = body;
    for (std::uint32_t t = 0; t < count; ++t) {
      const auto& [a, b, c] = body.triangles[t];
      if (t % 2) more.triangles.push_back({a, b, b});
      if (t % 3 == 0) more.triangles.push_back({c, b, c});
      if (t % 5 == 0) more.triangles.push_back({a, a, a});
    }
    for (const bool lines : {false, true}) {
      const SidedTool tool = toolOf(random, 100, 0.3, lines);
      for (const PairSettings& pair : {PairSettings{Method::Proximity, 0.1, Contacts::All},
                                       PairSettings{Method::Continuous, 0.02, Contacts::All}}) {
        const auto idsOfBody = [&](const Mesh& mesh) {
          std::set<Row> ids;
          const Rows rows(answer(mesh, tool, pair, Sidedness::Outer));
          for (const Row& id : idsOf(rows)) {
            const bool isOfBody = id[0] == 1 ? id[1] < count : id[1] != id[2];
            if (isOfBody) ids.insert(id);
          }
          return ids;
        };
        const std::set<Row> expected = idsOfBody(body);
        EXPECT_EQ(idsOfBody(more), expected);
        contacts += expected.size();
      }
    }
  }
  EXPECT_GE(contacts, leastOf(500));
}

/// One edge with any number of triangles, and a segment across a direction from it.
TEST(Sidedness, EdgesOfOneOrThreeTrianglesAreBelowIfAllAre) {
  Random random(6);
  int kept[4] = {}, suppressed[4] = {};
  for (int run = 0; run < 400; ++run) {
    const int count = std::array{0, 1, 3}[static_cast<std::size_t>(run % 3)];
    Mesh fan{{{0, 0, -1}, {0, 0, 1}}, {{0, 1, 1}}};  // without area
    for (int t = 0; t < count; ++t) {
      const double angle = uniform(random, 0, 6.28);
      const auto corner = static_cast<std::uint32_t>(fan.positions.size());
      fan.positions.push_back({std::cos(angle), std::sin(angle), 0});
      fan.triangles.push_back(random() % 2 ? Triangle{0, 1, corner} : Triangle{1, 0, corner});
    }
    const double angle = uniform(random, 0, 6.28);
    const Vector3d direction(std::cos(angle), std::sin(angle), 0),
        across(-direction.y(), direction.x(), 0);
    const auto hasContact = [&](const Vector3d& middle, const Vector3d& end) {
      const Positions ends{middle - end, middle + end};
      const CollisionData data = answer(
          fan, {ends, ends, {{0, 1}}}, {Method::Proximity, 0.125, Contacts::All}, Sidedness::Outer);
      return std::ranges::any_of(data.edgeEdge(), [](const EdgeEdgeContact& c) {
        return c.edgeA == Segment{0, 1};
      });
    };
    int below = 0;
    for (std::uint32_t t = 1; t < fan.triangles.size(); ++t)
      below += normalOf(fan, t).dot(direction) < 0;
    const bool expected = count == 0 || below < count;
    EXPECT_EQ(hasContact(0.1 * direction, 0.01 * across), expected) << run;
    ++(expected ? kept : suppressed)[count];
    EXPECT_TRUE(hasContact({0, 0, 0}, {0.25, 0, 0}));  // touching edges have no direction
  }
  EXPECT_TRUE(kept[0] > 50 && kept[1] > 50 && suppressed[1] > 50);
  EXPECT_TRUE(kept[3] > 50 && suppressed[3] > 10);
}

}  // namespace
}  // namespace palpate::testing
