#include <palpate/ConstraintRows.h>
#include <palpate/FeaturePairs.h>

#include "Common/ExpectRefused.h"
#include "Common/TestGeometry.h"

#include <Eigen/SparseCore>

#include <map>

namespace palpate::testing {
namespace {

/// A pair at some positions: its contacts and their rows. The second geometry's vertices are
/// numbered after the first's.
struct Rowed {
  CollisionData contacts;
  std::vector<ConstraintRow> rows;
  std::vector<double> distances;  ///< of the rows' contacts
  std::vector<std::vector<std::uint32_t>> keys;
};

Positions joined(const Positions& a, const Positions& b) {
  Positions all = a;
  all.insert(all.end(), b.begin(), b.end());
  return all;
}

void collect(Rowed& result, const SolverVertices& a, const SolverVertices& b) {
  appendRows(result.contacts, a, b, result.rows);
  const auto add = [&](const auto& contacts, auto&& key) {
    for (const auto& contact : contacts) {
      result.distances.push_back(contact.distance);
      result.keys.push_back(key(contact));
    }
  };
  using Key = std::vector<std::uint32_t>;
  const auto vertexTriangle = [](std::uint32_t kind) {
    return [kind](const VertexTriangleContact& c) { return Key{kind, c.vertex, c.triangle}; };
  };
  add(result.contacts.vertexTriangle(), vertexTriangle(0));
  add(result.contacts.triangleVertex(), vertexTriangle(1));
  add(result.contacts.edgeEdge(), [](const EdgeEdgeContact& c) {
    return Key{2, c.edgeA[0], c.edgeA[1], c.edgeB[0], c.edgeB[1]};
  });
  add(result.contacts.shape(), [](const ShapeContact& c) {
    return Key{3 + static_cast<std::uint32_t>(c.element), c.id, c.vertices[1], c.vertices[2]};
  });
}

/// all: the positions of the first geometry, then of the second. Self-collision has only the first.
Rowed rowed(const TestGeometry& a, const TestGeometry& b, const PairSettings& pair,
            const Positions& all) {
  const auto split = all.begin() + static_cast<std::ptrdiff_t>(a.positions.size());
  const Positions nowA(all.begin(), split), nowB(split, all.end());
  Rowed result{answer(settingsOf(Engine::Octree), a, b, pair, nowA, nowB), {}, {}, {}};
  const SolverVertices first{0, a.positions, nowA},
      second{static_cast<std::uint32_t>(nowA.size()), b.positions, nowB};
  collect(result, first, &a == &b ? first : second);
  return result;
}

Rowed rowed(const TestGeometry& a, const AnalyticalGeometry& shape, double thickness,
            const Positions& now) {
  OctreeBasedCD collisions;
  const GeometryId first = a.addTo(collisions), second = collisions.addAnalyticalGeometry(shape);
  collisions.addCollisionPair(first, second, {Method::Proximity, thickness, Contacts::All});
  collisions.setPositions(first, now);
  collisions.detectCollision();
  Rowed result{collisions.collisionData(first, second), {}, {}, {}};
  collect(result, {0, a.positions, now}, {});
  return result;
}

Eigen::SparseMatrix<double> jacobian(const Rowed& found, std::size_t vertices) {
  std::vector<Eigen::Triplet<double>> triplets;
  appendTriplets<Eigen::Triplet<double>>(found.rows, triplets);
  Eigen::SparseMatrix<double> matrix(static_cast<Eigen::Index>(found.rows.size()),
                                     static_cast<Eigen::Index>(3 * vertices));
  matrix.setFromTriplets(triplets.begin(), triplets.end());
  return matrix;
}

/// Compares gaps with distances, and the Jacobian with the change of lengths when all positions
/// move a little in random directions. lengthsOf(rowed, positions): one for each row. Returns how
/// many contacts were compared.
template <class Find, class Lengths>  // Rowed of positions
std::size_t expectDerivatives(Random& random, const Positions& at, Find&& find,
                              Lengths&& lengthsOf) {
  constexpr double kStep = 0x1p-18;
  const Rowed found = find(at);
  const std::vector<double> lengths = lengthsOf(found, at);
  EXPECT_EQ(found.rows.size(), found.distances.size());
  Eigen::VectorXd direction(3 * static_cast<Eigen::Index>(at.size()));
  for (double& component : direction) component = uniform(random, -1, 1);
  const auto lengthsAt = [&](double step) {
    Positions there = at;
    for (std::size_t i = 0; i < at.size(); ++i)
      there[i] += step * direction.segment<3>(3 * static_cast<Eigen::Index>(i));
    const Rowed near = find(there);
    const std::vector<double> its = lengthsOf(near, there);
    std::map<std::vector<std::uint32_t>, double> byKey;
    for (std::size_t r = 0; r < near.rows.size(); ++r) byKey[near.keys[r]] = its[r];
    return byKey;
  };
  const auto ahead = lengthsAt(kStep), behind = lengthsAt(-kStep);
  const Eigen::VectorXd predicted = jacobian(found, at.size()) * direction;
  std::size_t compared = 0;
  for (std::size_t r = 0; r < found.rows.size(); ++r) {
    const auto one = ahead.find(found.keys[r]), other = behind.find(found.keys[r]);
    if (one == ahead.end() || other == behind.end()) continue;  // at the thickness
    const double quotient = (one->second - other->second) / (2 * kStep);
    // The error of a central difference is the square of the step over the length.
    const double ratio = kStep / std::max(std::abs(lengths[r]), 1e-4);
    EXPECT_NEAR(predicted[static_cast<Eigen::Index>(r)], quotient, 1e-6 + 30 * ratio * ratio) << r;
    ++compared;
  }
  EXPECT_GE(2 * compared, found.rows.size());
  return compared;
}

/// The distances, which are the gaps.
const auto kDistances = [](const Rowed& found, const Positions& at) {
  for (std::size_t r = 0; r < found.rows.size(); ++r)
    EXPECT_NEAR(found.rows[r].gap(at), found.distances[r], 1e-13) << r;
  return found.distances;
};

/// The distances between centre lines and axes.
const auto kOfCentres = [](const Rowed& found, const Positions& at) {
  std::vector<double> lengths;
  for (const ConstraintRow& row : found.rows) {
    Vector3d sum = Vector3d::Zero();
    for (std::size_t i = 0; i < 4; ++i) sum += row.weights[i] * at[row.vertices[i]];
    lengths.push_back(sum.norm());
  }
  return lengths;
};

TEST(ConstraintRows, AreDerivativesOfDistancesForEveryGeometryType) {
  Random random(71);
  const TestGeometry sheets = testGeometry(sheet(6, 0.5, 0.3)),
                     triangles = testGeometry(soup(random, 60, 0.1)),
                     line = thread(random, 60, 0.1, 0.01, false),
                     points = particles(random, 60, 0.02);
  const Pairs pairs{{&sheets, &triangles}, {&triangles, &sheets}, {&triangles, &triangles},
                    {&sheets, &line},      {&line, &sheets},      {&line, &line},
                    {&line, &points},      {&points, &line},      {&points, &points},
                    {&points, &sheets}};
  for (const auto& [a, b] : pairs) {
    const PairSettings settings{Method::Proximity, 0.1, Contacts::All};
    const Positions at = a == b ? a->positions : joined(a->positions, b->positions);
    const auto rows = [&, &one = *a, &other = *b](const Positions& now) {
      return rowed(one, other, settings, now);
    };
    EXPECT_GT(expectDerivatives(random, at, rows, kDistances), 10u);
  }
}

TEST(ConstraintRows, AreDerivativesOfDistancesToShapes) {
  Random random(72);
  const TestGeometry triangles = testGeometry(soup(random, 60, 0.1)),
                     line = thread(random, 60, 0.1, 0.01, false),
                     points = particles(random, 60, 0.02);
  const std::vector<AnalyticalGeometry> shapes{Sphere{{0.5, 0.5, 0.5}, 0.25},
                                               Capsule{{0.3, 0.4, 0.5}, {0.7, 0.5, 0.6}, 0.2},
                                               Plane{{0.5, 0.5, 0.5}, {0.3, 0.1, 1}}};
  for (const TestGeometry* geometry : {&triangles, &line, &points}) {
    for (const AnalyticalGeometry& shape : shapes)
      EXPECT_GT(
          expectDerivatives(
              random, geometry->positions,
              [&](const Positions& now) { return rowed(*geometry, shape, 0.1, now); }, kDistances),
          10u);
  }
}

/// If radii differ along a line, the row has the gradient of the distance between the centre lines.
/// The distance itself also changes by the radius, because the closest point moves along.
TEST(ConstraintRows, AreDerivativesOfCentreLineDistancesForTaperedLines) {
  Random random(75);
  const TestGeometry line = tapered(random, thread(random, 60, 0.1, 0.01, false), 0.05),
                     sheets = testGeometry(sheet(6, 0.5, 0.3));
  for (const TestGeometry* other : {&sheets, &line}) {
    const Positions at = other == &line ? line.positions : joined(line.positions, other->positions);
    const auto rows = [&](const Positions& now) {
      return rowed(line, *other, {Method::Proximity, 0.1, Contacts::All}, now);
    };
    EXPECT_GT(expectDerivatives(random, at, rows, kOfCentres), 50u);
  }
}

/// At distance 0 the row has the gradient of the signed distance along the normal.
TEST(ConstraintRows, MeasureTouchingFeaturesAlongTheNormal) {
  const TestGeometry ground{
      GeometryType::Triangles, {{0, 0, 0}, {4, 0, 0}, {0, 4, 0}}, {{0, 1, 2}}, {}, {}},
      tip{GeometryType::Triangles, {{1, 1, 0}, {1, 2, 3}, {2, 1, 3}}, {{0, 1, 2}}, {}, {}};
  const Positions at = joined(tip.positions, ground.positions);
  const Rowed found = rowed(tip, ground, {Method::Proximity, 0.1}, at);
  ASSERT_EQ(found.rows.size(), 1u);
  EXPECT_EQ(found.distances[0], 0.0);
  EXPECT_EQ(found.rows[0].normal, Vector3d::UnitZ());
  for (const double height : {-0.25, 0.25}) {
    Positions there = at;
    there[0] += Vector3d(0.5, 0.25, height);
    EXPECT_EQ(found.rows[0].gap(there), height);
  }
}

TEST(ConstraintRows, TooFewPositionsThrowAnErrorThatNamesTheVertex) {
  using Span = std::span<const Vector3d>;
  const Positions low{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, high{{0, 0, 0.1}, {1, 0, 0.1}, {0, 1, 0.1}};
  const std::vector<Triangle> triangle{{0, 1, 2}};
  const CollisionData contacts =
      detectCollision({low, triangle}, {high, triangle}, {Method::Proximity, 0.2, Contacts::All});
  OctreeBasedCD collisions;
  const GeometryId points = collisions.addPointSet(high),
                   plane = collisions.addAnalyticalGeometry(Plane{});
  collisions.addCollisionPair(points, plane, {Method::Proximity, 0.2, Contacts::All});
  collisions.detectCollision();
  const CollisionData& beside = collisions.collisionData(points, plane);
  std::vector<ConstraintRow> rows(1);
  const Span all = high, two = all.first(2), none;
  const auto refuse = [&](const CollisionData& data, const std::string& words,
                          const SolverVertices& a, const SolverVertices& b,
                          std::optional<std::size_t> vertex) {
    expectRefused(
        ErrorCode::WrongPositionCount, words, [&] { appendRows(data, a, b, rows); }, {}, vertex);
    EXPECT_EQ(rows.size(), 1u);
  };
  const SolverVertices whole{0, high, high};
  for (const auto& [before, now] : {std::pair<Span, Span>{two, all}, {all, two}}) {
    refuse(contacts, " of b, which has ", {0, low, low}, {3, before, now}, 2);
    refuse(beside, " of a, which has ", {0, before, now}, {}, 2);
  }
  refuse(contacts, " of b, which has ", {0, low, low}, {3, none, none}, 0);
  refuse(beside, "", {}, {}, {});
  for (const Span before : {none, all})  // a shape has none at either end
    refuse(beside, "both sides have positions", whole, {0, before, high}, {});
  appendRows(contacts, {0, low, low}, {3, high, high}, rows);
  EXPECT_GT(rows.size(), 1u);
  rows.clear();
  appendRows(beside, whole, {}, rows);
  ASSERT_EQ(rows.size(), 3u);
  EXPECT_NEAR(rows[0].gap(high), 0.1, 1e-15);
}

std::vector<double> numbersOf(std::span<const ConstraintRow> rows) {
  std::vector<double> numbers;
  for (const ConstraintRow& row : rows) {
    numbers.insert(numbers.end(), row.vertices.begin(), row.vertices.end());
    numbers.insert(numbers.end(), row.weights.begin(), row.weights.end());
    numbers.insert(numbers.end(), row.normal.begin(), row.normal.end());
    numbers.push_back(row.offset);
  }
  return numbers;
}

/// The rows with Palpate's own positions have the bits of those with the caller's, for every type
/// of geometry and method, and so have those of a copy, whatever happens after it.
TEST(ConstraintRows, WithoutArraysTakeThePositionsOfTheStep) {
  Random random(77);
  const TestGeometry sheets = testGeometry(sheet(6, 0.5, 0.3)),
                     triangles = testGeometry(soup(random, 60, 0.1)),
                     line = thread(random, 60, 0.1, 0.01, false),
                     points = particles(random, 60, 0.02);
  const Pairs pairs{{&sheets, &triangles}, {&triangles, &sheets}, {&triangles, &triangles},
                    {&sheets, &line},      {&line, &line},        {&line, &points},
                    {&points, &triangles}};
  std::size_t rows = 0, impacts = 0;
  for (const auto& [a, b] : pairs)
    for (const Method method : {Method::Auto, Method::Proximity, Method::Continuous}) {
      const std::uint32_t firstOfB = a == b ? 10 : 1000;
      OctreeBasedCD collisions;
      const GeometryId first = a->addTo(collisions), second = a == b ? first : b->addTo(collisions);
      PairSettings pair{method, 0.05, Contacts::All};
      pair.smoothNormals = method == Method::Proximity && a == &sheets && b == &triangles;
      collisions.addCollisionPair(first, second, pair);
      collisions.advance();
      const Positions nowA = moved(random, a->positions, 0.05),
                      nowB = a == b ? nowA : moved(random, b->positions, 0.05);
      collisions.setPositions(first, nowA);
      collisions.setPositions(second, nowB);
      collisions.detectCollision();
      const CollisionData& data = collisions.collisionData(first, second);
      for (const auto& contact : data.edgeEdge()) impacts += contact.timeOfImpact < 1.0;
      std::vector<ConstraintRow> given, refused;
      appendRows(data, {10, a->positions, nowA}, {firstOfB, b->positions, nowB}, given);
      const auto expectSameAs = [&](const CollisionData& of) {
        std::vector<ConstraintRow> own;
        of.appendRows(own, 10, firstOfB);
        EXPECT_EQ(numbersOf(own), numbersOf(given));
      };
      expectSameAs(data);
      const CollisionData copy = data, copyOfCopy = copy;
      collisions.setPositions(first, moved(random, nowA, 0.05));  // a correction
      expectSameAs(data);
      collisions.advance();
      expectRefused(
          ErrorCode::InvalidCall, "is over", [&] { data.appendRows(refused); }, first);
      for (const CollisionData& late : {data, CollisionData(data.parts())})
        expectRefused(ErrorCode::NotAvailable, "not known", [&] { late.appendRows(refused); });
      EXPECT_TRUE(refused.empty());
      expectSameAs(copyOfCopy);
      rows += given.size();
    }
  EXPECT_GT(rows, 500u);
  EXPECT_GT(impacts, 20u);
}

/// With shapes and placed meshes the poses are those of the step, in either order.
TEST(ConstraintRows, WithoutArraysTakeThePosesOfTheStep) {
  Random random(78);
  const TestGeometry points = particles(random, 200, 0.02);
  const auto turned = [](double angle) {
    return Eigen::AngleAxisd(angle, Vector3d(0.6, 0, 0.8)).toRotationMatrix();
  };
  const Pose before{turned(0.1), {0.1, 0, 0}}, now{turned(0.3), {0.15, 0.02, 0}};
  const std::vector<AnalyticalGeometry> shapes{Sphere{{0.5, 0.5, 0.5}, 0.25},
                                               Capsule{{0.3, 0.4, 0.5}, {0.7, 0.5, 0.6}, 0.2}};
  for (const AnalyticalGeometry& shape : shapes)
    for (const bool shapeFirst : {false, true}) {
      OctreeBasedCD collisions;
      const GeometryId mesh = points.addTo(collisions),
                       tool = collisions.addAnalyticalGeometry(shape);
      const GeometryId a = shapeFirst ? tool : mesh, b = shapeFirst ? mesh : tool;
      collisions.addCollisionPair(a, b, {.thickness = 0.02});
      collisions.setTransform(tool, before, now);
      collisions.detectCollision();
      const CollisionData& data = collisions.collisionData(a, b);
      const SolverVertices vertices{5, points.positions, points.positions};
      std::vector<ConstraintRow> given, own;
      appendRows(data, shapeFirst ? SolverVertices{} : vertices,
                 shapeFirst ? vertices : SolverVertices{}, given, {before, now});
      data.appendRows(own, shapeFirst ? 77 : 5, shapeFirst ? 5 : 77);
      EXPECT_EQ(numbersOf(own), numbersOf(given));
      EXPECT_GT(own.size(), 3u);
    }
}

/// Positions that are not those of the step are refused where a row would be wrong: both ends the
/// same, exchanged ends or sides, other positions. Those of the step pass, also as floats.
TEST(ConstraintRows, RefusePositionsOfAnotherStep) {
  Random random(79);
  std::size_t refused = 0, wrong = 0;
  for (int i = 0; i < 200; ++i) {
    const double size = std::exp2(uniform(random, -20, 20)), radius = i % 2 ? 0.05 * size : 0.0;
    const auto scaled = [&](Positions all) {
      for (Vector3d& p : all) p = (size * p).cast<float>().cast<double>();
      return all;
    };
    const auto pointAt = [&](double lowest, double highest) {
      Vector3d point = randomPoint(random, -1, 1);
      point.z() = uniform(random, lowest, highest);
      return scaled({point});
    };
    const Positions ground = scaled({{-9, -9, 0}, {9, -9, 0}, {0, 15, 0}}), start = pointAt(0.3, 1),
                    end = pointAt(-1, -0.1), other = pointAt(-2, 2);
    OctreeBasedCD collisions;
    const GeometryId organ = collisions.addTriangleMesh(ground, std::vector<Triangle>{{0, 1, 2}}),
                     drop = collisions.addPointSet(start, radius);
    collisions.addCollisionPair(organ, drop, {.thickness = 0.1 * size});
    collisions.advance();
    collisions.setPositions(drop, end);
    collisions.detectCollision();
    const CollisionData& data = collisions.collisionData(organ, drop);
    ASSERT_EQ(data.triangleVertex().size(), 1u);
    ASSERT_LT(data.triangleVertex()[0].timeOfImpact, 1.0);
    std::vector<ConstraintRow> rows;
    appendRows(data, {0, ground, ground}, {3, start, end}, rows);
    EXPECT_NEAR(rows.at(0).offset, radius, 1e-5 * size);
    for (const auto& [before, now] :
         {std::pair(end, end), std::pair(start, start), std::pair(end, start),
          std::pair(start, other), std::pair(other, end)}) {
      rows.clear();
      try {
        appendRows(data, {0, ground, ground}, {3, before, now}, rows);
      } catch (const Error& error) {
        EXPECT_EQ(error.code(), ErrorCode::InvalidCall);
        EXPECT_TRUE(rows.empty());
        ++refused;
        continue;
      }
      // What passes is a sum of radii that the pair may have.
      EXPECT_GT(rows.at(0).offset, -1e-4 * size);
      EXPECT_LT(rows.at(0).offset, radius + 1e-4 * size);
      ++wrong;
    }
  }
  EXPECT_GT(refused, 800u);
  EXPECT_LT(wrong, 200u);
}

TEST(ConstraintRows, GapNeedsAPositionForEachVertex) {
  const Positions ground{{0, 0, 0}, {4, 0, 0}, {0, 4, 0}}, tip{{1, 1, 0.05}};
  OctreeBasedCD collisions;
  const GeometryId a = collisions.addPointSet(tip),
                   b = collisions.addTriangleMesh(ground, std::vector<Triangle>{{0, 1, 2}});
  collisions.addCollisionPair(a, b, {.thickness = 0.1});
  collisions.detectCollision();
  std::vector<ConstraintRow> rows;
  collisions.collisionData(a, b).appendRows(rows, 3, 0);
  ASSERT_EQ(rows.size(), 1u);
  const Positions all = joined(ground, tip);
  EXPECT_NEAR(rows[0].gap(all), 0.05, 1e-15);
  for (std::size_t count = 0; count < all.size(); ++count)
    expectRefused(
        ErrorCode::WrongPositionCount, "gap(): a row has vertex 3 ",
        [&] { rows[0].gap(std::span<const Vector3d>(all.data(), count)); }, {}, std::size_t{3});
}

/// The third law of ConstraintRow, of triangles that intersect and of triangles that are near.
TEST(ConstraintRows, StepToAGapGivesThatSignedDistance) {
  Random random(74);
  const TestGeometry triangles = testGeometry(soup(random, 2000, 0.2)),
                     sheets = testGeometry(sheet(3, 0.5, 0.3));
  const Positions at = joined(triangles.positions, sheets.positions);
  std::size_t compared = 0, behind = 0, outOfEdges = 0;
  for (const Method method : {Method::Intersection, Method::Proximity}) {
    const Rowed found = rowed(triangles, sheets, {method, 0.05, Contacts::All}, at);
    const std::size_t vertexRows =
        found.contacts.vertexTriangle().size() + found.contacts.triangleVertex().size();
    for (std::size_t r = 0; r < found.rows.size(); ++r) {
      const ConstraintRow& row = found.rows[r];
      std::array<Vector3d, 4> x, start;
      std::array<double, 4> inverseMasses;
      double sum = 0;
      for (int i = 0; i < 4; ++i) {
        start[i] = x[i] = at[row.vertices[i]];
        inverseMasses[i] = uniform(random, 0.1, 1) * (i > 0 ? 0.2 : 1);
        sum += inverseMasses[i] * row.weights[i] * row.weights[i];
      }
      const bool isVertex = r < vertexRows;
      const Vector3d u = isVertex ? Vector3d(x[2] - x[1]) : Vector3d(x[1] - x[0]),
                     v = isVertex ? Vector3d(x[3] - x[1]) : Vector3d(x[3] - x[2]);
      const double height =
          isVertex ? u.cross(v).norm() / std::max({u.norm(), v.norm(), (u - v).norm()})
                   : std::min(u.norm(), v.norm()) * u.normalized().cross(v.normalized()).norm();
      const bool isBehind = found.distances[r] < 0;
      const double goal = isBehind ? 0.01 : found.distances[r] + 0.02 * height;
      double longest = 0;
      for (int i = 0; i < 4; ++i) {
        const double share = (goal - found.distances[r]) * inverseMasses[i] * row.weights[i] / sum;
        x[i] += share * row.normal;
        if (i > 0 || !isVertex) longest = std::max(longest, std::abs(share));
      }
      const double tilt = 4 * longest / height;
      if (tilt > 0.5) continue;
      Vector3d difference;
      bool atFace = true;
      if (isVertex) {
        const auto before = vertexTriangleDistance(start[0], start[1], start[2], start[3]);
        atFace = before.feature == TriangleFeature::Face;
        difference = vertexTriangleDistance(x[0], x[1], x[2], x[3]).difference;
      } else {
        difference = edgeEdgeDistance(x[0], x[1], x[2], x[3]).difference;
      }
      const double reached =
          difference.dot(row.normal) < 0 ? -difference.norm() : difference.norm();
      if (isBehind && !atFace) {
        EXPECT_GT(reached, 0) << r;
        EXPECT_LE(reached, goal * (1 + 1e-9)) << r;
        ++outOfEdges;
      } else {
        EXPECT_NEAR(reached, goal, goal * tilt * tilt + 1e-13) << r;
        behind += isBehind;
      }
      ++compared;
    }
  }
  EXPECT_GT(compared, 1000u);
  EXPECT_GE(behind, 50u);
  EXPECT_GE(outOfEdges, 10u);
}

TEST(ConstraintRows, RowsOfImpactsHaveTheirGapWhereFeaturesTouch) {
  Random random(73);
  const TestGeometry triangles = testGeometry(soup(random, 80, 0.1)),
                     sheets = testGeometry(sheet(6, 0.5, 0.3));
  for (const Method method : {Method::Continuous, Method::Auto}) {
    for (const double thickness : {0.0, 0.02}) {
      const Positions before = joined(triangles.positions, sheets.positions),
                      now = moved(random, before, 0.1);
      const Rowed found = rowed(triangles, sheets, {method, thickness, Contacts::All}, now);
      EXPECT_GT(found.rows.size(), 20u);
      std::vector<double> times;
      forEachContact(found.contacts, [&](const auto& c) { times.push_back(c.timeOfImpact); });
      for (std::size_t r = 0; r < found.rows.size(); ++r) {
        Positions there = before;
        for (std::size_t i = 0; i < there.size(); ++i)
          there[i] = (1 - times[r]) * before[i] + times[r] * now[i];
        EXPECT_NEAR(found.rows[r].gap(there), found.distances[r], 1e-13) << r;
      }
    }
  }
}

/// The rows of a shape that moves refer to the shape at the step's end.
TEST(ConstraintRows, RowsOfAMovingShapeFollowItToTheEndOfTheStep) {
  Random random(76);
  const TestGeometry triangles = testGeometry(soup(random, 80, 0.1));
  const Positions before = triangles.positions, now = moved(random, before, 0.05);
  std::size_t impacts = 0;
  for (const double turn : {0.0, 0.7}) {
    RigidMotion motion;
    motion.before.translation = {-0.4, 0.1, 0};
    motion.now.translation = {0.9, 0, 0.2};
    motion.now.rotation =
        Eigen::AngleAxisd(turn, Vector3d(1, 2, 3).normalized()).toRotationMatrix();
    OctreeBasedCD collisions(settingsOf(Engine::Octree));
    const GeometryId mesh = triangles.addTo(collisions),
                     tool = collisions.addAnalyticalGeometry(Sphere{{0.1, 0.4, 0.5}, 0.2});
    collisions.addCollisionPair(mesh, tool, {Method::Continuous, 0.02, Contacts::All});
    collisions.setPositions(mesh, before, now);
    collisions.setTransform(tool, motion.before, motion.now);
    collisions.detectCollision();
    const CollisionData& contacts = collisions.collisionData(mesh, tool);
    std::vector<ConstraintRow> rows, rowsAtRest;
    appendRows(contacts, {0, before, now}, {}, rows, motion);
    appendRows(contacts, {0, before, now}, {}, rowsAtRest);
    ASSERT_EQ(rows.size(), contacts.shape().size());
    for (std::size_t r = 0; r < rows.size(); ++r) {
      const ShapeContact& c = contacts.shape()[r];
      const double time = c.timeOfImpact;
      impacts += time < 1.0;
      Vector3d point = Vector3d::Zero();  // of the element, at the end
      for (int i = 0; i < 3; ++i) point += c.weights[i] * now[c.vertices[i]];
      // The point of the shape that the contact touches, at the end.
      const Eigen::Matrix3d then = (1 - time) * motion.before.rotation + time * motion.now.rotation;
      const Vector3d body =
          then.inverse() *
          (c.pointOnShape - (1 - time) * motion.before.translation - time * motion.now.translation);
      const Vector3d opposite = motion.now.rotation * body + motion.now.translation;
      EXPECT_NEAR(rows[r].gap(now), c.normal.dot(point - opposite), 1e-12);
      EXPECT_NEAR(rowsAtRest[r].gap(now), c.normal.dot(point - c.pointOnShape), 1e-12);
    }
  }
  EXPECT_GT(impacts, 20u);
}

}  // namespace
}  // namespace palpate::testing
