#include <palpate/OctreeBasedCD.h>

#include "Common/ExpectRefused.h"
#include "Common/RandomMeshes.h"

#include <functional>
#include <limits>
#include <utility>

// Bad values for each public function that takes data. The call throws the right code, and the
// message names the ids. The object is unchanged: its state has the same bytes, and the next frame
// is that of an object with this state.

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

/// The expected error of a bad call: its code, and what the message and the error name.
struct Refusal {
  ErrorCode code;
  std::vector<std::string> named;  ///< at least one
  std::optional<GeometryId> geometry = std::nullopt;
  std::optional<std::size_t> element = std::nullopt;
};

void expectSceneRefuses(const std::function<void(Scene&)>& badCall, const Refusal& refusal) {
  ASSERT_FALSE(refusal.named.empty());
  for (const Stage stage : kStages) {
    SCOPED_TRACE(static_cast<int>(stage));
    Scene scene;
    bring(scene, stage);
    const std::vector<std::byte> before = scene.collisions.save();
    for (const std::string& words : refusal.named)
      testing::expectRefused(
          refusal.code, words, [&] { badCall(scene); }, refusal.geometry, refusal.element);
    EXPECT_TRUE(scene.collisions.save() == before);
    OctreeBasedCD twin;
    twin.restore(before);
    for (OctreeBasedCD* each : {&scene.collisions, &twin}) each->detectCollision();
    const std::uint64_t hash = twin.collisionData(scene.organ, scene.tool).hash();
    EXPECT_EQ(scene.collisions.collisionData(scene.organ, scene.tool).hash(), hash);
    EXPECT_GT(twin.statistics().contacts, 0u);
    EXPECT_EQ(scene.collisions.addPointSet({}), twin.addPointSet({}));
    if (::testing::Test::HasFailure()) return;
  }
}

/// For calls that are refused before they have a candidate.
const auto kUncalled = [](std::span<const ElementPair>) { ADD_FAILURE(); };

std::string text(GeometryId id) { return std::to_string(static_cast<std::uint32_t>(id)); }

/// Calls call(scene, settings) with every setting that is impossible or not supported yet.
template <class Call>
void expectPossible(Call call) {
  const auto refuse = [&](const PairSettings& settings, const Refusal& refusal) {
    expectSceneRefuses([&](Scene& scene) { call(scene, settings); }, refusal);
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
  for (const auto& [method, name] : {std::pair(Method::Intersection, "Method::Intersection"),
                                     {Method::Proximity, "Method::Proximity"},
                                     {Method::Continuous, "Method::Continuous"}})
    for (const double tolerance : {0.0, 0.25})
      refuse({.method = method, .thickness = 1, .automatic = {.motionTolerance = tolerance}},
             {ErrorCode::InvalidSettings, {"motionTolerance is ", name}});
  for (const double bad : {0.0, 0x1p-51, 1.5, -1.0, kNan})
    refuse({.continuous = {.timeTolerance = bad}},
           {ErrorCode::InvalidSettings, {"timeTolerance", "2^-50"}});
  for (const double bad : {-1.0, kInfinity, kNan})
    refuse({.freeMotionReach = bad}, {ErrorCode::InvalidSettings, {"freeMotionReach is"}});
  refuse({.method = static_cast<Method>(99), .thickness = 1}, {ErrorCode::InvalidSettings, {""}});
  refuse({.thickness = 1, .contacts = static_cast<Contacts>(99)},
         {ErrorCode::InvalidSettings, {""}});
}

TEST(BadInput, IsReportedWithTheNameOfTheGeometry) {
  OctreeBasedCD detection;
  const GeometryId liver = detection.addTriangleMesh(kOrgan, kOrganTriangles),
                   tool = detection.addTriangleMesh(kTool, kToolTriangles);
  EXPECT_EQ(detection.name(liver), "");
  detection.setName(liver, "liver");
  EXPECT_EQ(detection.name(liver), "liver");
  const std::string name = "geometry 0 \"liver\"", pair = "pair (0 \"liver\", 1)";
  Positions bad = kOrgan;
  bad[3][1] = kNan;
  Pose withNan;
  withNan.rotation(1, 2) = kNan;
  using testing::expectRefused;
  using enum ErrorCode;
  expectRefused(NonFinitePosition, name + ", vertex 3",
                [&] { detection.setPositions(liver, bad); });
  expectRefused(WrongPositionCount, name, [&] { detection.setPositions(liver, kTool); });
  expectRefused(InvalidTransform, name, [&] {
    detection.setTransform(liver, {2.0 * Eigen::Matrix3d::Identity(), Eigen::Vector3d::Zero()});
  });
  expectRefused(InvalidTransform, "rotation has an entry that is not finite",
                [&] { detection.setTransform(liver, withNan); });
  expectRefused(UnknownPair, pair, [&] { detection.collisionData(liver, tool); });
  detection.addCollisionPair(liver, tool);
  expectRefused(NotAvailable, pair, [&] { detection.collisionData(liver, tool); });
  expectRefused(UnknownPair, "pair (1, 0 \"liver\") was added as " + pair,
                [&] { detection.collisionData(tool, liver); });
  expectRefused(InvalidSettings, name, [&] { detection.queries().distance(liver, liver); });
  detection.publish();
  const auto snapshot = detection.latestSnapshot();
  detection.setName(liver, "");
  expectRefused(IndexOutOfRange, name, [&] { snapshot->position(liver, 1000, 1.0); });
  expectRefused(NonFinitePosition, "geometry 0, vertex 3",
                [&] { detection.setPositions(liver, bad); });
  expectRefused(UnknownGeometry, "geometry 7", [&] { detection.setName(GeometryId{7}, "x"); });
  // what() would end at the null character.
  expectRefused(InvalidSettings, "geometry 1: the name has a null character",
                [&] { detection.setName(tool, std::string("a\0b", 3)); });
  EXPECT_EQ(detection.name(tool), "");
}

TEST(BadInput, SettingsOutOfRange) {
  const auto refuse = [](const Settings& settings, const std::string& named) {
    testing::expectRefused(ErrorCode::InvalidSettings, named,
                           [&] { OctreeBasedCD collisions(settings); });
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

/// Each coordinate of each vertex in turn NaN and infinite.
TEST(BadInput, PositionsThatAreNotFinite) {
  const GeometryId organ = Scene().organ, tool = Scene().tool;
  struct Row {
    std::optional<GeometryId> geometry;  ///< that the error names
    std::function<void(Scene&, const Positions&)> call;
  };
  const Row rows[] = {
      {{}, [](Scene& s, const Positions& p) { s.collisions.addTriangleMesh(p, kOrganTriangles); }},
      {organ, [](Scene& s, const Positions& p) { s.collisions.setPositions(s.organ, p); }},
      {organ, [](Scene& s, const Positions& p) { s.collisions.setPositions(s.organ, p, kOrgan); }},
      {organ, [](Scene& s, const Positions& p) { s.collisions.setPositions(s.organ, kOrgan, p); }},
      {tool, [](Scene& s, const Positions& p) {
         s.collisions.setTriangles(s.tool, p, kOrganTriangles);
       }}};
  const std::pair<double, const char*> values[] = {
      {kNan, "nan"}, {kInfinity, "inf"}, {-kInfinity, "-inf"}};
  for (const Row& row : rows)
    for (std::size_t vertex = 0; vertex < kOrgan.size(); ++vertex)
      for (int axis = 0; axis < 3; ++axis)
        for (const auto& [value, word] : values) {
          Positions bad = kOrgan;
          bad[vertex][axis] = value;
          Refusal refusal{
              ErrorCode::NonFinitePosition, {std::to_string(vertex), word}, row.geometry, vertex};
          if (row.geometry) refusal.named.push_back(text(*row.geometry));
          expectSceneRefuses([&](Scene& scene) { row.call(scene, bad); }, refusal);
          if (HasFailure()) FAIL() << &row - rows << ", vertex " << vertex << ", " << word;
        }
}

/// Each corner of each triangle in turn out of range.
TEST(BadInput, IndicesOutOfRange) {
  const auto add = [](Scene& s, const Triangles& t) { s.collisions.addTriangleMesh(kTool, t); };
  const auto set = [](Scene& s, const Triangles& t) {
    s.collisions.setTriangles(s.other, kTool, t);
  };
  for (const bool isNew : {true, false})
    for (std::size_t triangle = 0; triangle < kToolTriangles.size(); ++triangle)
      for (int corner = 0; corner < 3; ++corner)
        for (const std::uint32_t index : {4u, 5u, 0x80000000u, 0xffffffffu}) {
          Triangles bad = kToolTriangles;
          bad[triangle][corner] = index;
          Refusal refusal{ErrorCode::IndexOutOfRange,
                          {std::to_string(triangle), std::to_string(index)},
                          {},
                          triangle};
          if (!isNew) refusal.geometry = Scene().other;
          expectSceneRefuses([&](Scene& s) { isNew ? add(s, bad) : set(s, bad); }, refusal);
          if (HasFailure()) FAIL() << "triangle " << triangle << ", index " << index;
        }
  expectSceneRefuses([](Scene& scene) { scene.collisions.addTriangleMesh({}, kToolTriangles); },
                     {ErrorCode::IndexOutOfRange, {""}});
}

/// Never added, and removed.
TEST(BadInput, UnknownGeometries) {
  const std::function<void(Scene&, GeometryId)> calls[] = {
      [](Scene& s, GeometryId id) { s.collisions.removeGeometry(id); },
      [](Scene& s, GeometryId id) { s.collisions.setPositions(id, kTool); },
      [](Scene& s, GeometryId id) { s.collisions.setPositions(id, kTool, kTool); },
      [](Scene& s, GeometryId id) { s.collisions.setTriangles(id, kTool, kToolTriangles); },
      [](Scene& s, GeometryId id) { s.collisions.addCollisionPair(id, s.tool); },
      [](Scene& s, GeometryId id) { s.collisions.addCollisionPair(s.tool, id); },
      [](Scene& s, GeometryId id) { s.collisions.addCollisionPair(id, id); },
      [](Scene& s, GeometryId id) { s.collisions.setPairSettings(id, s.tool, {}); },
      [](Scene& s, GeometryId id) { s.collisions.setPairSettings(s.tool, id, {}); },
      [](Scene& s, GeometryId id) { s.collisions.removeCollisionPair(id, s.tool); },
      [](Scene& s, GeometryId id) { s.collisions.removeCollisionPair(s.tool, id); },
      [](Scene& s, GeometryId id) { s.collisions.forEachCandidate(id, s.tool, kUncalled); },
      [](Scene& s, GeometryId id) { s.collisions.forEachCandidate(s.tool, id, kUncalled); },
      [](Scene& s, GeometryId id) { s.collisions.candidatePairs(id, s.tool); },
      [](Scene& s, GeometryId id) { s.collisions.candidatePairs(s.tool, id); },
      [](Scene& s, GeometryId id) { s.collisions.collisionData(id, s.tool); },
      [](Scene& s, GeometryId id) { s.collisions.collisionData(s.tool, id); }};
  for (const auto& call : calls)
    for (const GeometryId id : {kNeverAdded, Scene().removed, GeometryId{0xffffffffu}}) {
      SCOPED_TRACE(&call - calls);
      expectSceneRefuses([&](Scene& scene) { call(scene, id); },
                         {ErrorCode::UnknownGeometry, {text(id)}, id});
    }
}

/// The pairs are (organ, tool) and (organ, organ).
TEST(BadInput, UnknownAndDuplicatePairs) {
  constexpr auto kUnknown = ErrorCode::UnknownPair, kTwice = ErrorCode::DuplicatePair;
  const Scene names;
  const std::string organ = text(names.organ), tool = text(names.tool), other = text(names.other);
  struct Row {
    ErrorCode code;
    std::vector<std::string> named;
    void (*call)(Scene&);
  };
  const Row rows[] = {
      {kTwice, {organ, tool}, [](Scene& s) { s.collisions.addCollisionPair(s.organ, s.tool); }},
      {kTwice, {organ, tool}, [](Scene& s) { s.collisions.addCollisionPair(s.tool, s.organ); }},
      {kTwice, {organ}, [](Scene& s) { s.collisions.addCollisionPair(s.organ, s.organ); }},
      {kUnknown, {other}, [](Scene& s) { s.collisions.setPairSettings(s.organ, s.other, {}); }},
      {kUnknown, {other}, [](Scene& s) { s.collisions.removeCollisionPair(s.organ, s.other); }},
      {kUnknown, {tool}, [](Scene& s) { s.collisions.removeCollisionPair(s.tool, s.tool); }},
      {kUnknown, {""}, [](Scene& s) { s.collisions.forEachCandidate(s.tool, s.other, kUncalled); }},
      {kUnknown, {""}, [](Scene& s) { s.collisions.candidatePairs(s.tool, s.other); }},
      {kUnknown, {""}, [](Scene& s) { s.collisions.collisionData(s.tool, s.other); }},
      {kUnknown, {tool, organ}, [](Scene& s) { s.collisions.collisionData(s.tool, s.organ); }}};
  for (const Row& row : rows) {
    SCOPED_TRACE(&row - rows);
    expectSceneRefuses(row.call, {row.code, row.named});
  }
}

TEST(BadInput, WrongPositionCounts) {
  const GeometryId organ = Scene().organ;
  for (const std::size_t count :
       {std::size_t{0}, std::size_t{1}, kOrgan.size() - 1, kOrgan.size() + 1}) {
    const Positions wrong(count, Eigen::Vector3d(1, 2, 3));
    const Refusal refusal{ErrorCode::WrongPositionCount,
                          {text(organ), std::to_string(count), std::to_string(kOrgan.size())},
                          organ};
    for (const int which : {0, 1, 2})
      expectSceneRefuses(
          [&](Scene& s) {
            if (which == 0) s.collisions.setPositions(s.organ, wrong);
            if (which == 1) s.collisions.setPositions(s.organ, wrong, kOrgan);
            if (which == 2) s.collisions.setPositions(s.organ, kOrgan, wrong);
          },
          refusal);
  }
  using enum ErrorCode;
  const Positions some(3, {7, 7, 7});
  const std::string name = "geometry " + text(organ);
  for (const auto& [first, printed] :
       {std::pair(5ll, "5"), {4294967295ll, "4294967295"}, {-1ll, "-1"}})
    expectSceneRefuses(
        [&, from = first](Scene& s) { s.collisions.setPositions(organ, from, some); },
        {WrongPositionCount,
         {name + ": 3 positions given from vertex " + printed + " on, but it has 7 vertices"},
         organ});
  const Positions infinite{{1, 2, 3}, {0, kInfinity, 0}};
  expectSceneRefuses([&](Scene& s) { s.collisions.setPositions(organ, 4, infinite); },
                     {NonFinitePosition, {"vertex 5: position is"}, organ, 5});
}

TEST(BadInput, ImpossiblePairSettings) {
  expectPossible([](Scene& scene, const PairSettings& settings) {
    scene.collisions.addCollisionPair(scene.organ, scene.other, settings);
  });
  expectPossible([](Scene& scene, const PairSettings& settings) {
    scene.collisions.setPairSettings(scene.organ, scene.tool, settings);
  });
  expectPossible([](Scene& scene, const PairSettings& settings) {
    scene.collisions.setPairSettings(scene.tool, scene.organ, settings);
  });
  PairSettings unused{Method::Proximity, 1};
  unused.automatic.motionTolerance = -2;
  EXPECT_NO_THROW(Scene().collisions.setPairSettings(Scene().organ, Scene().tool, unused));
}

TEST(BadInput, OneCallPath) {
  const auto refuse = [](const TriangleMeshView& a, const TriangleMeshView& b,
                         const PairSettings& settings, const Refusal& refusal) {
    for (const std::string& named : refusal.named)
      testing::expectRefused(
          refusal.code, named, [&] { detectCollision(a, b, settings); }, {}, refusal.element);
  };
  const TriangleMeshView organ{kOrgan, kOrganTriangles}, tool{kTool, kToolTriangles};
  Positions infinite = kTool;
  infinite[2].y() = -kInfinity;
  const Triangles beyond{{0, 1, 2}, {0, 4, 3}};
  for (const auto& [bad, refusal] :
       {std::pair(TriangleMeshView{infinite, kToolTriangles},
                  Refusal{ErrorCode::NonFinitePosition, {"2"}, {}, 2}),
        std::pair(TriangleMeshView{kTool, beyond},
                  Refusal{ErrorCode::IndexOutOfRange, {"1", "4"}, {}, 1})}) {
    refuse(organ, bad, {}, refusal);
    refuse(bad, organ, {}, refusal);
  }
  refuse(organ, tool, {.thickness = -1}, {ErrorCode::InvalidSettings, {"-1"}});
  refuse(organ, tool, {.method = Method::Continuous},
         {ErrorCode::UnsupportedMethod, {"Continuous", "step"}});
  EXPECT_GT(detectCollision(organ, tool, {.thickness = kThickness}).hash(), 0u);
}

}  // namespace
}  // namespace palpate
