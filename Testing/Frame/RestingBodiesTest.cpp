#include "Common/DegenerateCases.h"
#include "Common/PairRun.h"
#include "Common/RandomMeshes.h"
#include "Common/Sanitized.h"

#include <palpate/ConstraintRows.h>
#include <palpate/OctreeBasedCD.h>

#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

// Bodies whose surfaces touch exactly, and overlap nowhere: they rest on each other, also over
// edges. Coordinates are multiples of 1/4.
namespace palpate::testing {
namespace {

using Eigen::Vector3d;

/// One of the 48 turns and mirrorings of a cube, which keep multiples of 1/4.
struct Orientation {
  std::array<int, 3> axes{0, 1, 2};
  Vector3d signs{1, 1, 1};

  explicit Orientation(Random& random) {
    for (int i = 2; i > 0; --i) std::swap(axes[i], axes[random() % (i + 1)]);
    for (int i = 0; i < 3; ++i) signs[i] = random() % 2 ? 1 : -1;
  }
  Vector3d operator()(const Vector3d& p) const {
    return {signs[0] * p[axes[0]], signs[1] * p[axes[1]], signs[2] * p[axes[2]]};
  }
  bool isMirror() const {
    const int order = (axes[1] - axes[0] + 3) % 3 == 1 ? 1 : -1;
    return order * signs.prod() < 0;
  }
  Mesh of(Mesh mesh) const {
    for (Vector3d& p : mesh.positions) p = (*this)(p);
    if (isMirror())
      for (Triangle& t : mesh.triangles) std::swap(t[1], t[2]);
    return mesh;
  }
};

double quarters(Random& random, double low, double high) {
  const auto count = static_cast<std::uint64_t>(4 * (high - low)) + 1;
  return low + 0.25 * static_cast<double>(random() % count);
}

/// A table, and what lies on it and hangs over its edges.
struct RestScene {
  Mesh table, body;
  std::vector<Vector3d> before;  ///< of the body
};

/// depth: how far the body is in the table. splits: edges that triangles without area split.
RestScene restScene(Random& random, bool isCloth, bool slides, double depth, int splits) {
  RestScene scene;
  scene.table = dividedBox({-2, -2, -2}, {2, 2, 0}, 1 + static_cast<int>(random() % 2));
  const auto pointOf = [&](double low, double high, double z) {
    const double x = quarters(random, low, high);
    return Vector3d(x, quarters(random, low, high), z);
  };
  const Vector3d size = pointOf(0.5, 2.5, 1);
  if (isCloth) {
    scene.body = flat(4, 0);
    for (Vector3d& p : scene.body.positions) p = p.cwiseProduct(size);
  } else {
    scene.body = dividedBox({0, 0, 0}, size, 1 + static_cast<int>(random() % 2));
  }
  const Vector3d at = pointOf(-3, 1.5, -depth);
  for (Vector3d& p : scene.body.positions) p += at;
  const Orientation orientation(random);
  scene.table = orientation.of(scene.table);
  scene.body = orientation.of(scene.body);
  for (; splits > 0; --splits) addFlatTriangles(random, random() % 2 ? scene.table : scene.body);
  scene.before = scene.body.positions;
  if (slides) {
    const Vector3d way = orientation(pointOf(-0.5, 0.5, 0));
    for (Vector3d& p : scene.before) p -= way;
  }
  return scene;
}

struct RestAnswer {
  double least = 0;  ///< the least distance of a contact, or 0
  bool trusted = false, intersecting = false;
  std::size_t inside = 0;
};
RestAnswer answerOf(const RestScene& scene, bool isCloth, Method method, double thickness) {
  OctreeBasedCD collisions(settingsOf(Engine::Octree));
  const GeometryId table = addMesh(collisions, scene.table), body = addMesh(collisions, scene.body);
  PairSettings settings{.method = method};
  settings.thickness = thickness;
  collisions.addCollisionPair(body, table, settings);
  collisions.setPositions(body, scene.before, scene.body.positions);
  collisions.detectCollision();
  const CollisionData& data = collisions.collisionData(body, table);
  RestAnswer answer;
  const auto add = [&](const auto& contacts) {
    for (const auto& c : contacts) answer.least = std::min(answer.least, c.distance);
  };
  add(data.vertexTriangle());
  add(data.triangleVertex());
  add(data.edgeEdge());
  answer.trusted = data.validity().trusted;
  if (!isCloth)  // has no inside
    answer.intersecting = collisions.queries().penetration(body, table).intersecting;
  std::vector<InsideVertex> inside;
  collisions.queries().findInsideVertices(body, table, inside);
  answer.inside = inside.size();
  return answer;
}

TEST(RestingBodies, HaveNoContactWithADepthWhereTheyTouch) {
  Random random(7);
  for (int run = 0; run < casesOf(300); ++run)
    for (const bool isCloth : {false, true})
      for (const bool slides : {false, true}) {
        const RestScene scene = restScene(random, isCloth, slides, 0, run % 2 ? 16 : 0);
        for (const Method method : {Method::Intersection, Method::Auto}) {
          if (slides && method == Method::Intersection) continue;
          const RestAnswer answer =
              answerOf(scene, isCloth, method, method == Method::Auto && run % 2 ? 0.125 : 0);
          EXPECT_GE(answer.least, 0.0) << run << ' ' << isCloth << slides << int(method);
          EXPECT_FALSE(answer.intersecting);
          EXPECT_EQ(answer.inside, 0u);
        }
      }
}

/// Whether a body begins on the table, and not beside it.
bool beginsOnTable(const RestScene& scene) {
  Eigen::AlignedBox3d body, table;
  for (const Vector3d& p : scene.before) body.extend(p);
  for (const Vector3d& p : scene.table.positions) table.extend(p);
  return ((body.max().cwiseMin(table.max()) - body.min().cwiseMax(table.min())).array() > 0)
             .count() == 2;
}

/// Bodies that slide along the table, also over its rims, only touch it: no row holds them back.
TEST(RestingBodies, SlideWithoutResistance) {
  Random random(9);
  std::size_t rowCount = 0;
  for (int run = 0; run < casesOf(200); ++run)
    for (const bool isCloth : {false, true}) {
      const RestScene scene = restScene(random, isCloth, true, 0, 0);
      if (!beginsOnTable(scene)) continue;
      OctreeBasedCD collisions(settingsOf(Engine::Octree));
      const GeometryId table = addMesh(collisions, scene.table),
                       body = addMesh(collisions, scene.body);
      PairSettings settings{.method = run % 2 ? Method::Auto : Method::Continuous};
      settings.smoothNormals = run % 3 == 0;
      collisions.addCollisionPair(body, table, settings);
      collisions.setPositions(body, scene.before, scene.body.positions);
      collisions.detectCollision();
      std::vector<ConstraintRow> rows;
      const auto size = static_cast<std::uint32_t>(scene.body.positions.size());
      collisions.collisionData(body, table).appendRows(rows, 0, size);
      std::vector<Vector3d> now = scene.body.positions;
      now.insert(now.end(), scene.table.positions.begin(), scene.table.positions.end());
      rowCount += rows.size();
      for (const ConstraintRow& row : rows)
        EXPECT_GE(row.gap(now), -1e-12) << "run " << run << ", along " << row.normal.transpose();
    }
  EXPECT_GE(rowCount, leastOf(1000));
}

/// The same bodies, a quarter lower: what overlaps has a depth, of a quarter at most.
TEST(RestingBodies, HaveADepthWhereTheyAreLower) {
  Random random(8);
  int overlapping = 0;
  for (int run = 0; run < casesOf(100); ++run) {
    const RestScene scene = restScene(random, false, false, 0.25, run % 2 ? 16 : 0);
    for (const Method method : {Method::Intersection, Method::Auto}) {
      const RestAnswer answer = answerOf(scene, false, method, 0);
      overlapping += answer.intersecting;
      EXPECT_EQ(answer.least < 0, answer.intersecting) << run << ' ' << int(method);
    }
  }
  EXPECT_GE(overlapping, static_cast<int>(leastOf(100)));
}

/// A rigid body under gravity, and a table that stands still. Vertices of the body move freely in a
/// step, and are then led back to its shape.
class FallingBody {
 public:
  FallingBody(const Mesh& body, const Mesh& table)
      : m_size(body.positions.size()), m_x(body.positions), m_velocities(m_size, Vector3d::Zero()) {
    for (const Vector3d& p : m_x) m_shape.push_back(p - middle());
    m_start = middle();
    m_x.insert(m_x.end(), table.positions.begin(), table.positions.end());
    m_body = addMesh(m_collisions, body);
    m_table = addMesh(m_collisions, table);
    m_collisions.addCollisionPair(m_body, m_table, {});
    m_collisions.advance();
  }

  void step() {
    const double duration = 0.01;
    const std::vector<Vector3d> before = positions();
    for (std::size_t v = 0; v < m_size; ++v) {
      m_velocities[v].z() -= 9.81 * duration;
      m_x[v] += duration * m_velocities[v];
    }
    for (int round = 0; round < 3; ++round) {
      detect(before);
      std::vector<ConstraintRow> rows;
      m_collisions.collisionData(m_body, m_table)
          .appendRows(rows, 0, static_cast<std::uint32_t>(m_size));
      for (int iteration = 0; iteration < 10; ++iteration) {
        for (const ConstraintRow& row : rows) push(row);
        keepShape();
      }
    }
    detect(before);
    m_collisions.advance();
    for (std::size_t v = 0; v < m_size; ++v) m_velocities[v] = (m_x[v] - before[v]) / duration;
  }

  Vector3d moved() const { return middle() - m_start; }
  double speed() const {
    double most = 0;
    for (const Vector3d& v : m_velocities) most = std::max(most, v.norm());
    return most;
  }

 private:
  std::vector<Vector3d> positions() const {
    return {m_x.begin(), m_x.begin() + static_cast<std::ptrdiff_t>(m_size)};
  }
  Vector3d middle() const {
    Vector3d sum = Vector3d::Zero();
    for (std::size_t v = 0; v < m_size; ++v) sum += m_x[v];
    return sum / static_cast<double>(m_size);
  }
  void detect(const std::vector<Vector3d>& before) {
    m_collisions.setPositions(m_body, before, positions());
    m_collisions.detectCollision();
  }
  void push(const ConstraintRow& row) {
    double mobility = 0;
    for (int i = 0; i < 4; ++i)
      if (row.vertices[i] < m_size) mobility += row.weights[i] * row.weights[i];
    const double gap = row.gap(m_x);
    if (gap >= 0 || mobility == 0) return;
    for (int i = 0; i < 4; ++i)
      if (row.vertices[i] < m_size)
        m_x[row.vertices[i]] -= row.weights[i] * gap / mobility * row.normal;
  }
  void keepShape() {
    const Vector3d at = middle();
    Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
    for (std::size_t v = 0; v < m_size; ++v) sum += (m_x[v] - at) * m_shape[v].transpose();
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(sum, Eigen::ComputeFullU | Eigen::ComputeFullV);
    const Eigen::Matrix3d rotation = svd.matrixU() * svd.matrixV().transpose();
    for (std::size_t v = 0; v < m_size; ++v) m_x[v] = at + rotation * m_shape[v];
  }

  OctreeBasedCD m_collisions{Settings{.threads = 1}};
  GeometryId m_body{}, m_table{};
  std::size_t m_size;
  std::vector<Vector3d> m_x;  ///< of the body, then of the table
  std::vector<Vector3d> m_velocities, m_shape;
  Vector3d m_start;
};

/// With the default settings a cube lies on tables over whose edges and corners it hangs. It sinks
/// in by what a solver leaves, and must be held at the edges, too.
TEST(RestingBodies, LieStillOverEdgesWithThicknessZero) {
  const Vector3d lower[] = {{-10, -5, -1}, {-10, -10, -1}, {-0.3, -5, -1}, {-0.5, -0.5, -1}},
                 upper[] = {{0, 5, 0}, {0, 0, 0}, {0.3, 5, 0}, {0.5, 0.5, 0}},
                 middles[] = {{-0.3, 0.1, 1}, {-0.3, -0.3, 1}, {0, 0.1, 1}, {0.1, 0.05, 1}};
  std::size_t number = 0;
  for (int table = 0; table < 4; ++table)
    for (const double turn : {0.0, 0.3, 1.0})
      for (const int divisions : {1, 2}) {
        if (isLeftOut(number++)) continue;
        Mesh cube = dividedBox({-1, -1, -1}, {1, 1, 1}, divisions);
        for (Vector3d& p : cube.positions) {
          const double z = p.z();
          p = Eigen::AngleAxisd(turn, Vector3d::UnitZ()) * p;
          p = Vector3d(p.x(), p.y(), z) + middles[table];
        }
        FallingBody body(cube,
                         dividedBox(lower[table], upper[table], 1 + static_cast<int>(number % 2)));
        double furthest = 0;
        for (int step = 0; step < 200; ++step) {
          body.step();
          furthest = std::max(furthest, std::abs(body.moved().z()));
        }
        EXPECT_LE(furthest, 0.01) << table << ' ' << turn << ' ' << divisions;
        EXPECT_LE(body.speed(), 0.1) << table << ' ' << turn << ' ' << divisions;
      }
}

}  // namespace
}  // namespace palpate::testing
