#include <palpate/OctreeBasedCD.h>

#include "Common/ExpectRefused.h"
#include "Common/RandomMeshes.h"

#include <gtest/gtest.h>

#include <functional>
#include <limits>
#include <memory>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

// Bad values for each public function that takes data. The call throws the right code, and the
// message names the ids. The object is unchanged: everything that can be read is as before, and
// later frames match a twin that never got the bad call.

namespace palpate {
namespace {

using Positions = std::vector<Eigen::Vector3d>;
using Triangles = std::vector<Triangle>;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr GeometryId kNeverAdded{77};
constexpr double kThickness = 0.2;

/// An octahedron, and a vertex in no triangle.
const Positions kOrgan{{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0},
                       {0, 0, 1}, {0, 0, -1}, {5, 5, 5}};
const Triangles kOrganTriangles{{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4},
                                {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}};
/// A square of two triangles just above the octahedron.
const Positions kTool{{-1, -1, 1.1}, {1, -1, 1.1}, {1, 1, 1.1}, {-1, 1, 1.1}};
const Triangles kToolTriangles{{0, 1, 2}, {0, 2, 3}};

Positions raised(Positions positions, double z) {
  for (Eigen::Vector3d& p : positions) p += Eigen::Vector3d(0.01 * z, 0, z);
  return positions;
}

/// Three meshes and two pairs. A fourth mesh was added and removed.
struct Scene {
  OctreeBasedCD collisions{Settings{.threads = 1}};
  GeometryId removed = collisions.addTriangleMesh(kTool, kToolTriangles);
  GeometryId organ = collisions.addTriangleMesh(kOrgan, kOrganTriangles);
  GeometryId tool = collisions.addTriangleMesh(kTool, kToolTriangles);
  GeometryId other = collisions.addTriangleMesh(raised(kTool, 0.02), kToolTriangles);

  Scene() {
    collisions.addCollisionPair(organ, tool, {.thickness = kThickness});
    collisions.addCollisionPair(organ, organ);
    collisions.removeGeometry(removed);
  }
};

enum class Stage { NoFrameYet, AfterFrame, NewPositions };
constexpr Stage kStages[]{Stage::NoFrameYet, Stage::AfterFrame, Stage::NewPositions};

void bring(Scene& scene, Stage stage) {
  if (stage == Stage::NoFrameYet) return;
  scene.collisions.detectCollision();
  if (stage == Stage::AfterFrame) return;
  scene.collisions.setPositions(scene.tool, raised(kTool, -0.05));
}

/// Everything that can be read, as one value.
std::vector<std::uint64_t> state(const Scene& scene) {
  std::vector<std::uint64_t> values;
  for (const CollisionPair& pair : scene.collisions.pairs()) {
    values.insert(values.end(),
                  {static_cast<std::uint64_t>(pair.a), static_cast<std::uint64_t>(pair.b),
                   static_cast<std::uint64_t>(pair.settings.method),
                   static_cast<std::uint64_t>(pair.settings.contacts),
                   std::hash<double>{}(pair.settings.thickness)});
    try {
      values.push_back(scene.collisions.collisionData(pair.a, pair.b).hash());
    } catch (const Error& error) {
      values.push_back(static_cast<std::uint64_t>(error.code()));
    }
  }
  const FrameStatistics& statistics = scene.collisions.statistics();
  values.insert(values.end(),
                {statistics.geometries, statistics.triangles, statistics.candidatePairs,
                 statistics.featurePairs, statistics.contacts});
  return values;
}

/// The expected error of a bad call: its code, and what the message and the error name.
struct Refusal {
  ErrorCode code;
  std::vector<std::string> named;
  std::optional<GeometryId> geometry = std::nullopt;
  std::optional<std::size_t> element = std::nullopt;
};

void expectSays(const Error& error, const Refusal& refusal) {
  const std::string sentence = error.what();
  EXPECT_EQ(static_cast<int>(error.code()), static_cast<int>(refusal.code)) << sentence;
  for (const std::string& name : refusal.named)
    EXPECT_NE(sentence.find(name), std::string::npos) << "'" << name << "' is not in: " << sentence;
  if (refusal.geometry) {
    EXPECT_EQ(error.geometry(), refusal.geometry) << sentence;
  }
  if (refusal.element) {
    EXPECT_EQ(error.element(), refusal.element) << sentence;
  }
}

void expectRefused(const std::function<void(Scene&)>& badCall, const Refusal& refusal) {
  for (Stage stage : kStages) {
    Scene scene, twin;
    bring(scene, stage);
    bring(twin, stage);
    bool refused = false;
    try {
      badCall(scene);
    } catch (const Error& error) {
      refused = true;
      expectSays(error, refusal);
    }
    EXPECT_TRUE(refused);
    EXPECT_EQ(state(scene), state(twin));

    for (double z : {0.0, -0.03}) {  // first what was already set, then a new frame
      for (Scene* each : {&scene, &twin}) {
        if (z != 0) each->collisions.setPositions(each->organ, raised(kOrgan, z));
        each->collisions.detectCollision();
      }
      EXPECT_EQ(state(scene), state(twin));
      EXPECT_GT(twin.collisions.statistics().contacts, 0u);
    }
    EXPECT_EQ(scene.collisions.addTriangleMesh(kTool, kToolTriangles),
              twin.collisions.addTriangleMesh(kTool, kToolTriangles));
    if (::testing::Test::HasFailure()) FAIL() << "in stage " << static_cast<int>(stage);
  }
}

std::string text(GeometryId id) { return std::to_string(static_cast<std::uint32_t>(id)); }

/// Calls call(scene, positions) with each coordinate of each vertex in turn NaN and infinite.
template <class Call>
void expectFinite(const Positions& good, std::optional<GeometryId> geometry, Call call) {
  for (std::size_t vertex = 0; vertex < good.size(); ++vertex) {
    for (int axis = 0; axis < 3; ++axis) {
      for (double value : {kNan, kInfinity, -kInfinity}) {
        Positions bad = good;
        bad[vertex][axis] = value;
        Refusal refusal{ErrorCode::NonFinitePosition, {}, geometry, vertex};
        refusal.named = {std::to_string(vertex), value != value ? "nan"
                                                 : value < 0    ? "-inf"
                                                                : "inf"};
        if (geometry) refusal.named.push_back(text(*geometry));
        expectRefused([&](Scene& scene) { call(scene, bad); }, refusal);
        if (::testing::Test::HasFailure()) FAIL() << "vertex " << vertex << ", " << value;
      }
    }
  }
}

/// Calls call(scene, triangles) with each corner of each triangle in turn out of range.
template <class Call>
void expectInRange(std::size_t vertexCount, const Triangles& good,
                   std::optional<GeometryId> geometry, Call call) {
  const auto count = static_cast<std::uint32_t>(vertexCount);
  for (std::size_t triangle = 0; triangle < good.size(); ++triangle) {
    for (int corner = 0; corner < 3; ++corner) {
      for (std::uint32_t index : {count, count + 1, 0x80000000u, 0xffffffffu}) {
        Triangles bad = good;
        bad[triangle][corner] = index;
        Refusal refusal{ErrorCode::IndexOutOfRange, {}, geometry, triangle};
        refusal.named = {std::to_string(triangle), std::to_string(index)};
        expectRefused([&](Scene& scene) { call(scene, bad); }, refusal);
        if (::testing::Test::HasFailure()) FAIL() << "triangle " << triangle << ", index " << index;
      }
    }
  }
}

/// Calls call(scene, id) with ids that do not exist: never added, and removed.
template <class Call>
void expectKnown(Call call) {
  const GeometryId removed = Scene().removed;
  for (GeometryId id : {kNeverAdded, removed, GeometryId{0xffffffffu}})
    expectRefused([&](Scene& scene) { call(scene, id); },
                  {ErrorCode::UnknownGeometry, {text(id)}, id});
}

/// Calls call(scene, settings) with every setting that is impossible or not supported yet.
template <class Call>
void expectPossible(Call call) {
  const auto refuse = [&](const PairSettings& settings, const Refusal& refusal) {
    expectRefused([&](Scene& scene) { call(scene, settings); }, refusal);
  };
  for (Method method :
       {Method::Auto, Method::Proximity, Method::Intersection, Method::Continuous}) {
    refuse({.method = method, .thickness = -0.125}, {ErrorCode::InvalidSettings, {"-0.125"}});
    refuse({.method = method, .thickness = kNan}, {ErrorCode::InvalidSettings, {"nan"}});
    refuse({.method = method, .thickness = kInfinity}, {ErrorCode::InvalidSettings, {"inf"}});
    refuse({.method = method, .thickness = -std::numeric_limits<double>::denorm_min()},
           {ErrorCode::InvalidSettings, {"thickness"}});
  }
  refuse({.method = Method::Proximity}, {ErrorCode::InvalidSettings, {"Proximity", "thickness"}});
  refuse({.method = Method::Proximity, .thickness = -0.0},
         {ErrorCode::InvalidSettings, {"Proximity", "thickness"}});
  for (Method method : {Method::Auto, Method::Proximity, Method::Intersection})
    refuse({.method = method, .thickness = 1, .continuous = {.earliestTimeOnly = true}},
           {ErrorCode::InvalidSettings, {"earliestTimeOnly", "Continuous"}});
  for (const double bad : {0.0, 0x1p-51, 1.5, -1.0, kNan})
    refuse({.continuous = {.timeTolerance = bad}},
           {ErrorCode::InvalidSettings, {"timeTolerance", "2^-50"}});
  refuse({.method = static_cast<Method>(99), .thickness = 1}, {ErrorCode::InvalidSettings, {}});
  refuse({.thickness = 1, .contacts = static_cast<Contacts>(99)}, {ErrorCode::InvalidSettings, {}});
}

TEST(BadInput, IsReportedWithTheNameOfTheGeometry) {
  OctreeBasedCD detection;
  const testing::Mesh ball = testing::sphere(5, 8, {0, 0, 0}, 1.0);
  const GeometryId liver = detection.addTriangleMesh(ball.positions, ball.triangles),
                   tool = detection.addTriangleMesh(ball.positions, ball.triangles);
  EXPECT_EQ(detection.name(liver), "");
  detection.setName(liver, "liver");
  EXPECT_EQ(detection.name(liver), "liver");
  const std::string name = "geometry 0 \"liver\"", pair = "pair (0 \"liver\", 1)";
  auto bad = ball.positions;
  bad[3][1] = std::numeric_limits<double>::quiet_NaN();
  using testing::expectRefused;
  expectRefused(ErrorCode::NonFinitePosition, name + ", vertex 3",
                [&] { detection.setPositions(liver, bad); });
  expectRefused(ErrorCode::NonFinitePosition, name + ", vertex 3",
                [&] { detection.setTriangles(liver, bad, ball.triangles); });
  expectRefused(ErrorCode::WrongPositionCount, name,
                [&] { detection.setPositions(liver, std::span(bad).first(3)); });
  expectRefused(ErrorCode::InvalidTransform, name, [&] {
    detection.setTransform(liver, {2.0 * Eigen::Matrix3d::Identity(), Eigen::Vector3d::Zero()});
  });
  Eigen::Matrix3d withNan = Eigen::Matrix3d::Identity();
  withNan(1, 2) = bad[3][1];
  expectRefused(ErrorCode::InvalidTransform, "rotation has an entry that is not finite", [&] {
    detection.setTransform(liver, {withNan, Eigen::Vector3d::Zero()});
  });
  expectRefused(ErrorCode::UnknownPair, pair, [&] { detection.collisionData(liver, tool); });
  detection.addCollisionPair(liver, tool);
  expectRefused(ErrorCode::NotAvailable, pair, [&] { detection.collisionData(liver, tool); });
  expectRefused(ErrorCode::UnknownPair, "pair (1, 0 \"liver\") was added as " + pair,
                [&] { detection.collisionData(tool, liver); });
  detection.detectCollision();
  expectRefused(ErrorCode::InvalidSettings, name,
                [&] { detection.queries().distance(liver, liver); });
  detection.publish();
  const auto snapshot = detection.latestSnapshot();
  detection.setName(liver, "");
  expectRefused(ErrorCode::IndexOutOfRange, name, [&] { snapshot->position(liver, 1000, 1.0); });
  expectRefused(ErrorCode::NonFinitePosition, "geometry 0, vertex 3",
                [&] { detection.setPositions(liver, bad); });
  expectRefused(ErrorCode::UnknownGeometry, "geometry 7",
                [&] { detection.setName(GeometryId{7}, "x"); });
  // what() would end at the null character.
  expectRefused(ErrorCode::InvalidSettings, "geometry 1: the name has a null character",
                [&] { detection.setName(tool, std::string("a\0b", 3)); });
  EXPECT_EQ(detection.name(tool), "");
}

TEST(BadInput, SettingsOutOfRange) {
  const auto refuse = [](const Settings& settings, const std::string& named) {
    try {
      OctreeBasedCD collisions(settings);
      ADD_FAILURE() << named << " was accepted";
    } catch (const Error& error) {
      expectSays(error, {ErrorCode::InvalidSettings, {named}});
    }
  };
  for (int depth : {-1, 0, 61, std::numeric_limits<int>::max(), std::numeric_limits<int>::min()})
    refuse({.octree = {.maxDepth = depth}}, "maxDepth");
  for (int most : {-1, 0, 1025, std::numeric_limits<int>::max()})
    refuse({.octree = {.maxElementsPerLeaf = most}}, "maxElementsPerLeaf");
  for (int threads : {-1, 1025, std::numeric_limits<int>::max()})
    refuse({.threads = threads}, "threads");
  refuse({.octree = {.update = static_cast<OctreeUpdate>(99)}}, "update");
  refuse({.octree = {.bounds = static_cast<OctreeBounds>(3)}}, "octree.bounds");
  refuse({.engine = static_cast<Engine>(99)}, "engine");
  // The ends of the ranges are valid.
  for (int depth : {1, 60})
    for (int most : {1, 1024})
      EXPECT_NO_THROW(OctreeBasedCD(
          Settings{.octree = {.maxDepth = depth, .maxElementsPerLeaf = most}, .threads = 1}));
}

TEST(BadInput, AddTriangleMesh) {
  expectFinite(kOrgan, {}, [](Scene& scene, const Positions& positions) {
    scene.collisions.addTriangleMesh(positions, kOrganTriangles);
  });
  expectInRange(kTool.size(), kToolTriangles, {}, [](Scene& scene, const Triangles& triangles) {
    scene.collisions.addTriangleMesh(kTool, triangles);
  });
  expectRefused([](Scene& scene) { scene.collisions.addTriangleMesh({}, kToolTriangles); },
                {ErrorCode::IndexOutOfRange, {}});
}

TEST(BadInput, RemoveGeometry) {
  expectKnown([](Scene& scene, GeometryId id) { scene.collisions.removeGeometry(id); });
}

TEST(BadInput, SetPositions) {
  const GeometryId organ = Scene().organ;
  expectKnown([](Scene& scene, GeometryId id) { scene.collisions.setPositions(id, kTool); });
  expectFinite(kOrgan, organ, [](Scene& scene, const Positions& positions) {
    scene.collisions.setPositions(scene.organ, positions);
  });
  for (std::size_t count : {std::size_t{0}, std::size_t{1}, kOrgan.size() - 1, kOrgan.size() + 1}) {
    const Positions wrong(count, Eigen::Vector3d(1, 2, 3));
    const Refusal refusal{ErrorCode::WrongPositionCount,
                          {text(organ), std::to_string(count), std::to_string(kOrgan.size())},
                          organ};
    expectRefused([&](Scene& scene) { scene.collisions.setPositions(scene.organ, wrong); },
                  refusal);
    expectRefused([&](Scene& scene) { scene.collisions.setPositions(scene.organ, wrong, kOrgan); },
                  refusal);
    expectRefused([&](Scene& scene) { scene.collisions.setPositions(scene.organ, kOrgan, wrong); },
                  refusal);
  }
}

TEST(BadInput, SetPositionsBeforeAndNow) {
  const GeometryId organ = Scene().organ;
  expectKnown([](Scene& scene, GeometryId id) { scene.collisions.setPositions(id, kTool, kTool); });
  expectFinite(kOrgan, organ, [](Scene& scene, const Positions& positions) {
    scene.collisions.setPositions(scene.organ, positions, raised(kOrgan, 0.3));
  });
  expectFinite(kOrgan, organ, [](Scene& scene, const Positions& positions) {
    scene.collisions.setPositions(scene.organ, raised(kOrgan, 0.3), positions);
  });
}

TEST(BadInput, SetTriangles) {
  const GeometryId tool = Scene().tool;
  expectKnown([](Scene& scene, GeometryId id) {
    scene.collisions.setTriangles(id, kTool, kToolTriangles);
  });
  expectFinite(kOrgan, tool, [](Scene& scene, const Positions& positions) {
    scene.collisions.setTriangles(scene.tool, positions, kOrganTriangles);
  });
  expectInRange(kOrgan.size(), kOrganTriangles, tool, [](Scene& scene, const Triangles& triangles) {
    scene.collisions.setTriangles(scene.tool, kOrgan, triangles);
  });
}

TEST(BadInput, AddCollisionPair) {
  expectKnown(
      [](Scene& scene, GeometryId id) { scene.collisions.addCollisionPair(id, scene.tool); });
  expectKnown(
      [](Scene& scene, GeometryId id) { scene.collisions.addCollisionPair(scene.tool, id); });
  expectKnown([](Scene& scene, GeometryId id) { scene.collisions.addCollisionPair(id, id); });
  expectPossible([](Scene& scene, const PairSettings& settings) {
    scene.collisions.addCollisionPair(scene.organ, scene.other, settings);
  });
  const Scene names;
  const Refusal twice{ErrorCode::DuplicatePair, {text(names.organ), text(names.tool)}};
  expectRefused([](Scene& scene) { scene.collisions.addCollisionPair(scene.organ, scene.tool); },
                twice);
  expectRefused([](Scene& scene) { scene.collisions.addCollisionPair(scene.tool, scene.organ); },
                twice);
  expectRefused(
      [](Scene& scene) {
        scene.collisions.addCollisionPair(scene.organ, scene.tool, {.thickness = 3});
      },
      twice);
  expectRefused([](Scene& scene) { scene.collisions.addCollisionPair(scene.organ, scene.organ); },
                {ErrorCode::DuplicatePair, {text(names.organ)}});
}

TEST(BadInput, SetPairSettings) {
  expectKnown(
      [](Scene& scene, GeometryId id) { scene.collisions.setPairSettings(id, scene.tool, {}); });
  expectKnown(
      [](Scene& scene, GeometryId id) { scene.collisions.setPairSettings(scene.tool, id, {}); });
  expectPossible([](Scene& scene, const PairSettings& settings) {
    scene.collisions.setPairSettings(scene.organ, scene.tool, settings);
  });
  expectPossible([](Scene& scene, const PairSettings& settings) {
    scene.collisions.setPairSettings(scene.tool, scene.organ, settings);
  });
  const Scene names;
  expectRefused(
      [](Scene& scene) { scene.collisions.setPairSettings(scene.organ, scene.other, {}); },
      {ErrorCode::UnknownPair, {text(names.organ), text(names.other)}});
}

TEST(BadInput, RemoveCollisionPair) {
  expectKnown(
      [](Scene& scene, GeometryId id) { scene.collisions.removeCollisionPair(scene.tool, id); });
  expectKnown(
      [](Scene& scene, GeometryId id) { scene.collisions.removeCollisionPair(id, scene.tool); });
  const Scene names;
  expectRefused(
      [](Scene& scene) { scene.collisions.removeCollisionPair(scene.organ, scene.other); },
      {ErrorCode::UnknownPair, {text(names.organ), text(names.other)}});
  expectRefused([](Scene& scene) { scene.collisions.removeCollisionPair(scene.tool, scene.tool); },
                {ErrorCode::UnknownPair, {text(names.tool)}});
}

TEST(BadInput, ForEachCandidate) {
  const auto ask = [](Scene& scene, GeometryId a, GeometryId b) {
    scene.collisions.forEachCandidate(a, b, [](std::span<const ElementPair>) { FAIL(); });
  };
  expectKnown([&](Scene& scene, GeometryId id) { ask(scene, scene.tool, id); });
  expectKnown([&](Scene& scene, GeometryId id) { ask(scene, id, scene.tool); });
  expectRefused([&](Scene& scene) { ask(scene, scene.tool, scene.other); },
                {ErrorCode::UnknownPair, {}});
}

TEST(BadInput, CollisionData) {
  const auto ask = [](const Scene& scene, GeometryId a, GeometryId b) {
    scene.collisions.collisionData(a, b);
  };
  expectKnown([&](Scene& scene, GeometryId id) { ask(scene, scene.tool, id); });
  expectKnown([&](Scene& scene, GeometryId id) { ask(scene, id, scene.tool); });
  expectRefused([&](Scene& scene) { ask(scene, scene.tool, scene.other); },
                {ErrorCode::UnknownPair, {}});
  const Scene names;
  expectRefused([&](Scene& scene) { ask(scene, scene.tool, scene.organ); },
                {ErrorCode::UnknownPair, {text(names.tool), text(names.organ)}});
}

TEST(BadInput, CandidatePairs) {
  const auto ask = [](Scene& scene, GeometryId a, GeometryId b) {
    scene.collisions.candidatePairs(a, b);
  };
  expectKnown([&](Scene& scene, GeometryId id) { ask(scene, scene.tool, id); });
  expectKnown([&](Scene& scene, GeometryId id) { ask(scene, id, scene.tool); });
  expectRefused([&](Scene& scene) { ask(scene, scene.tool, scene.other); },
                {ErrorCode::UnknownPair, {}});
}

TEST(BadInput, OneCallPath) {
  const auto refuse = [](const TriangleMeshView& a, const TriangleMeshView& b,
                         const PairSettings& settings, const Refusal& refusal) {
    try {
      detectCollision(a, b, settings);
      ADD_FAILURE() << "accepted";
    } catch (const Error& error) {
      expectSays(error, refusal);
    }
  };
  const TriangleMeshView organ{kOrgan, kOrganTriangles}, tool{kTool, kToolTriangles};
  for (double value : {kNan, kInfinity, -kInfinity}) {
    Positions bad = kTool;
    bad[2].y() = value;
    const TriangleMeshView badTool{bad, kToolTriangles};
    const Refusal refusal{ErrorCode::NonFinitePosition, {"2"}, {}, 2};
    refuse(organ, badTool, {}, refusal);
    refuse(badTool, organ, {}, refusal);
  }
  const Triangles badTriangles{{0, 1, 2}, {0, 4, 3}};
  const TriangleMeshView badTool{kTool, badTriangles};
  const Refusal refusal{ErrorCode::IndexOutOfRange, {"1", "4"}, {}, 1};
  refuse(organ, badTool, {}, refusal);
  refuse(badTool, organ, {}, refusal);
  refuse(organ, tool, {.thickness = -1}, {ErrorCode::InvalidSettings, {"-1"}});
  refuse(organ, tool, {.method = Method::Proximity}, {ErrorCode::InvalidSettings, {"Proximity"}});
  refuse(organ, tool, {.method = Method::Continuous},
         {ErrorCode::UnsupportedMethod, {"Continuous", "step"}});
  EXPECT_GT(detectCollision(organ, tool, {.thickness = kThickness}).hash(), 0u);
}

}  // namespace
}  // namespace palpate
