#include <palpate/ArrayAdapter.h>

#include "Common/ExpectRefused.h"
#include "Common/TestGeometry.h"

namespace palpate::testing {
namespace {

/// Like the arrays of simulators: contiguous vectors of N numbers.
template <class T, int N>
class VecArray {
 public:
  using Vec = Eigen::Matrix<T, N, 1>;
  void push_back(const Vec& value) { m_values.push_back(value); }
  int size() const { return static_cast<int>(m_values.size()); }
  const Vec& operator[](int i) const { return m_values[static_cast<std::size_t>(i)]; }

 private:
  std::vector<Vec> m_values;
};

enum class CellKind { Vertex, Edge, Triangle };
struct CellElement {
  int ids[4] = {7, 7, 7, 7};
  int idCount = 0;
  CellKind cellType = CellKind::Vertex;
};

struct Arrays {
  VecArray<double, 3> positions;
  VecArray<int, 3> triangles;
};

Arrays arraysOf(const TestGeometry& geometry) {
  Arrays arrays;
  for (const Vector3d& p : geometry.positions) arrays.positions.push_back(p);
  for (const auto& [a, b, c] : geometry.triangles)
    arrays.triangles.push_back(
        Eigen::Vector3i(static_cast<int>(a), static_cast<int>(b), static_cast<int>(c)));
  return arrays;
}

/// The cells of both sides of a pair.
std::array<std::vector<CellElement>, 2> cellsOf(const CollisionData& contacts) {
  std::array<std::vector<CellElement>, 2> cells;
  appendCells(contacts, CellTypes<CellKind>{CellKind::Vertex, CellKind::Edge, CellKind::Triangle},
              cells[0], cells[1]);
  EXPECT_GT(cells[0].size(), 10u);
  EXPECT_EQ(cells[0].size(), cells[1].size());
  return cells;
}

TEST(ArrayAdapter, GivesTheSameContactsAsSpans) {
  Random random(81);
  const TestGeometry first = testGeometry(sheet(6, 0.5, 0.3)),
                     second = testGeometry(soup(random, 60, 0.1));
  const PairSettings settings{Method::Proximity, 0.1, Contacts::All};
  const CollisionData truth = answer(first, second, settings);

  const Arrays a = arraysOf(first), b = arraysOf(second);
  OctreeBasedCD collisions;
  const GeometryId idA = collisions.addTriangleMesh(positionsOf(a.positions),
                                                    elementsOf<3>(a.triangles)),
                   idB = collisions.addTriangleMesh(positionsOf(b.positions),
                                                    elementsOf<3>(b.triangles));
  EXPECT_EQ(static_cast<const void*>(positionsOf(a.positions).data()), &a.positions[0]);
  collisions.addCollisionPair(idA, idB, settings);
  collisions.detectCollision();
  const CollisionData& contacts = collisions.collisionData(idA, idB);
  EXPECT_EQ(contacts.hash(), truth.hash());

  const auto [cellsA, cellsB] = cellsOf(contacts);
  ASSERT_EQ(cellsA.size(), Rows(truth).contacts());
  EXPECT_GT(truth.vertexTriangle().size() * truth.triangleVertex().size() * truth.edgeEdge().size(),
            0u);
  const auto expectCell = [](const CellElement& cell, CellKind kind,
                             std::vector<std::uint32_t> ids) {
    EXPECT_EQ(cell.cellType, kind);
    ASSERT_EQ(cell.idCount, static_cast<int>(ids.size()));
    for (std::size_t i = 0; i < 4; ++i)
      EXPECT_EQ(cell.ids[i], i < ids.size() ? static_cast<int>(ids[i]) : -1);
  };
  std::size_t at = 0;
  for (const auto& c : truth.vertexTriangle()) {
    expectCell(cellsA[at], CellKind::Vertex, {c.vertex});
    expectCell(cellsB[at++], CellKind::Triangle, {c.triangle});
  }
  for (const auto& c : truth.triangleVertex()) {
    expectCell(cellsA[at], CellKind::Triangle, {c.triangle});
    expectCell(cellsB[at++], CellKind::Vertex, {c.vertex});
  }
  for (const auto& c : truth.edgeEdge()) {
    expectCell(cellsA[at], CellKind::Edge, {c.edgeA[0], c.edgeA[1]});
    expectCell(cellsB[at++], CellKind::Edge, {c.edgeB[0], c.edgeB[1]});
  }
}

TEST(ArrayAdapter, FlatArraysAreTriplesAndElements) {
  const std::vector<double> coordinates{0, 1, 2, 3, 4, 5};
  const std::span<const Vector3d> positions = positionsOf(coordinates);
  ASSERT_EQ(positions.size(), 2u);
  EXPECT_EQ(positions[1], Vector3d(3, 4, 5));
  EXPECT_EQ(static_cast<const void*>(positions.data()), coordinates.data());
  EXPECT_TRUE(positionsOf(std::vector<double>()).empty());
  const std::vector<int> indices{0, 1, 2, 3, 2, 1, 0, 3};
  EXPECT_EQ(elementsOf<4>(indices), (std::vector<Tetrahedron>{{0, 1, 2, 3}, {2, 1, 0, 3}}));
  EXPECT_EQ(elementsOf<2>(indices).size(), 4u);
  expectRefused(ErrorCode::WrongPositionCount, "8 indices", [&] { elementsOf<3>(indices); });
  expectRefused(ErrorCode::WrongPositionCount, "7 coordinates",
                [] { positionsOf(std::vector<double>(7)); });
}

/// A segment is a cell of two vertices, a point a vertex. Intersection adds the pairs that
/// intersect.
TEST(ArrayAdapter, CellsAreOfEveryTypeAndMethod) {
  Random random(82);
  const TestGeometry points = particles(random, 200, 0.02),
                     line = thread(random, 60, 0.1, 0.02, false),
                     sheets = testGeometry(sheet(6, 0.5, 0.3)),
                     triangles = testGeometry(soup(random, 60, 0.1));
  const PairSettings near{Method::Proximity, 0.1, Contacts::All};
  const auto ofLine = cellsOf(answer(points, line, near))[1];
  for (const CellElement& cell : ofLine) {
    EXPECT_EQ(cell.cellType, CellKind::Edge);
    EXPECT_EQ(cell.idCount, 2);
    EXPECT_EQ(std::abs(cell.ids[1] - cell.ids[0]), 1);  // consecutive vertices of the thread
  }
  const CollisionData contacts = answer(points, points, near);
  const auto ofPoints = cellsOf(contacts)[1];
  for (std::size_t i = 0; i < ofPoints.size(); ++i) {
    EXPECT_EQ(ofPoints[i].cellType, CellKind::Vertex);
    EXPECT_EQ(ofPoints[i].ids[0], static_cast<int>(contacts.vertexTriangle()[i].triangle));
  }
  for (const Method method : {Method::Intersection, Method::Auto}) {
    const CollisionData data = answer(sheets, triangles, {.method = method});
    const std::span<const ElementPair> pairs = data.intersectingTriangles();
    EXPECT_GT(pairs.size(), 10u);
    const auto cells = cellsOf(data);
    const std::size_t first = Rows(data).contacts();
    ASSERT_EQ(cells[0].size(), first + (method == Method::Intersection ? pairs.size() : 0));
    for (std::size_t i = first; i < cells[0].size(); ++i)
      for (const std::size_t side : {0, 1}) {
        const ElementPair& pair = pairs[i - first];
        EXPECT_EQ(cells[side][i].cellType, CellKind::Triangle);
        EXPECT_EQ(cells[side][i].ids[0], static_cast<int>(side == 0 ? pair.a : pair.b));
      }
  }
}

/// A vertex buffer for drawing: floats, with normals between the positions.
TEST(ArrayAdapter, CopiesPositionsWithAStride) {
  const std::vector<float> buffer{0, 1, 2, 9, 9, 9, 3, 4, 5.5f, 9, 9, 9};
  const std::vector<Vector3d> expected{{0, 1, 2}, {3, 4, 5.5}};
  const std::span<const float> numbers(buffer);
  EXPECT_EQ(copyPositions(numbers, 6), expected);
  EXPECT_EQ(copyPositions(numbers.first(9), 6), expected);  // the last position ends the buffer
  EXPECT_EQ(copyPositions(numbers.subspan(1), 6).front(), Vector3d(1, 2, 9));
  EXPECT_EQ(copyPositions(numbers).size(), 4u);
  EXPECT_TRUE(copyPositions(std::span<const double>()).empty());
  expectRefused(ErrorCode::WrongPositionCount, "8 numbers with a stride of 6",
                [&] { copyPositions(numbers.first(8), 6); });
  expectRefused(ErrorCode::InvalidSettings, "The stride is 2", [&] { copyPositions(numbers, 2); });
}

TEST(ArrayAdapter, TakesIndicesOfAnyWidthAndQuads) {
  const std::vector<std::uint16_t> narrow{0, 1, 65535, 2, 1, 0};
  const std::vector<Triangle> expected{{0, 1, 65535}, {2, 1, 0}};
  EXPECT_EQ(elementsOf<3>(std::span<const std::uint16_t>(narrow)), expected);
  const std::vector<std::int64_t> wide(narrow.begin(), narrow.end());
  EXPECT_EQ(elementsOf<3>(std::span(wide)), expected);
  const std::vector<Tetrahedron> quads{{0, 1, 2, 3}, {3, 2, 4, 5}};
  const std::vector<Triangle> halves{{0, 1, 2}, {0, 2, 3}, {3, 2, 4}, {3, 4, 5}};
  EXPECT_EQ(trianglesOfQuads(std::span(quads)), halves);
  const std::vector<std::uint32_t> flat{0, 1, 2, 3, 3, 2, 4, 5};
  EXPECT_EQ(trianglesOfQuads(std::span(flat)), halves);
  const std::vector<std::uint64_t> beyond{0, 1, 2, 0, 1, std::uint64_t{1} << 32};
  expectRefused(ErrorCode::IndexOutOfRange, "Element 1 has the index 4294967296",
                [&] { elementsOf<3>(std::span(beyond)); });
}

TEST(ArrayAdapter, RefusesNegativeIndices) {
  VecArray<int, 2> segments;
  segments.push_back({0, 1});
  segments.push_back({1, -1});
  expectRefused(
      ErrorCode::IndexOutOfRange, "Element 1 has the index -1.", [&] { elementsOf<2>(segments); },
      {}, 1);
}

}  // namespace
}  // namespace palpate::testing
