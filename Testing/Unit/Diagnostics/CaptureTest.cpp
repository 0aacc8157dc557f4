#include <palpate/Capture.h>

#include "Common/CallText.h"
#include "Common/ExpectRefused.h"
#include "Common/FailingAllocation.h"
#include "Common/RandomMeshes.h"
#include "Common/Replayed.h"
#include "Common/Sanitized.h"
#include "Common/TemporaryFolder.h"
#include "Common/WholeScene.h"

#include <gtest/gtest.h>

#include <cstring>
#include <fstream>
#include <limits>

namespace palpate {
namespace {

namespace fs = std::filesystem;
using testing::FailingAllocation;
using testing::Mesh;
using testing::Random;

class Capture : public ::testing::Test {
 protected:
  fs::path file(const char* name = "file.capture") const { return m_folder.path / name; }
  void write(const std::string& text) const {
    std::ofstream(file(), std::ios::binary | std::ios::trunc) << text;
  }

  /// Expects that the file is refused with its name and `reason`.
  void expectRefused(const std::string& reason) const {
    for (const std::string& named : {file().string(), reason})
      testing::expectRefused(ErrorCode::File, named, [&] { readCapture(file()); });
  }

  testing::TemporaryFolder m_folder;
};

bool sameBits(const std::vector<Eigen::Vector3d>& l, const std::vector<Eigen::Vector3d>& r) {
  return l.size() == r.size() &&
         (l.empty() || std::memcmp(l.data(), r.data(), l.size() * sizeof l[0]) == 0);
}

void expectSame(const CollisionProblem& l, const CollisionProblem& r) {
  using testing::textOf;
  EXPECT_EQ(l.settings.engine, r.settings.engine);
  EXPECT_EQ(l.settings.threads, r.settings.threads);
  EXPECT_EQ(textOf(l.settings.octree), textOf(r.settings.octree));
  ASSERT_EQ(l.geometries.size(), r.geometries.size());
  for (std::size_t i = 0; i < l.geometries.size(); ++i) {
    const CollisionProblem::Geometry &a = l.geometries[i], &b = r.geometries[i];
    EXPECT_EQ(a.id, b.id);
    EXPECT_TRUE(sameBits(a.before, b.before));
    EXPECT_TRUE(sameBits(a.now, b.now));
    EXPECT_EQ(a.triangles, b.triangles);
    EXPECT_EQ(a.tetrahedra, b.tetrahedra);
    EXPECT_EQ(a.radii, b.radii);
    EXPECT_EQ(a.disabled, b.disabled);
    EXPECT_EQ(a.filter, b.filter);
  }
  ASSERT_EQ(l.pairs.size(), r.pairs.size());
  for (std::size_t i = 0; i < l.pairs.size(); ++i) {
    EXPECT_EQ(l.pairs[i].a, r.pairs[i].a);
    EXPECT_EQ(l.pairs[i].b, r.pairs[i].b);
    EXPECT_EQ(l.pairs[i].method, r.pairs[i].method);
    EXPECT_EQ(textOf(l.pairs[i].settings), textOf(r.pairs[i].settings));
  }
}

/// Geometries 1 and 2 of three, after a frame in which they moved; pairs (2, 1), (1, 1).
OctreeBasedCD movedScene() {
  Random random(3);
  const Mesh first = testing::soup(random, 20, 0.3), second = testing::sphere(4, 5, {0, 0, 0}, 1);
  OctreeBasedCD detection({.octree = {.maxDepth = 9,
                                      .maxElementsPerLeaf = 4,
                                      .update = OctreeUpdate::Rebuild,
                                      .bounds = OctreeBounds::Dop18},
                           .threads = 2});
  const GeometryId removed = detection.addTriangleMesh(first.positions, first.triangles);
  const GeometryId a = detection.addTriangleMesh(first.positions, first.triangles);
  const GeometryId b = detection.addTriangleMesh(second.positions, second.triangles);
  detection.removeGeometry(removed);
  detection.addCollisionPair(
      b, a, {.thickness = 0.1, .contacts = Contacts::All, .continuous = {.timeTolerance = 0x1p-9}});
  detection.addCollisionPair(a, a);
  detection.detectCollision();
  detection.advance();
  std::vector<Eigen::Vector3d> now = first.positions;
  for (Eigen::Vector3d& p : now) p += testing::randomPoint(random, -0.1, 0.1);
  detection.setPositions(a, now);
  detection.detectCollision();
  return detection;
}

/// Placed bodies, radii, tetrahedra, a rest distance, settings of a proxy, and every filter.
TEST_F(Capture, KeepsEveryGeometryTypeMethodAndFilter) {
  const testing::WholeSceneInput input(8);
  Settings audited{.threads = 1};
  audited.audit.features = testing::kShareOfCases == 1 ? 1'000'000 : 60;
  testing::WholeScene scene(input, audited);
  OctreeBasedCD& detection = scene.detection;
  detection.setPairSettings(scene.drops, scene.bone,
                            {.method = Method::Proxy,
                             .thickness = 0.1,
                             .allowedError = 0.0123,
                             .trackContacts = true,
                             .proxy = {.widestNormalCone = 0.21},
                             .priority = -5});
  detection.setCollisionFilter(scene.organ, {3, 5, Sidedness::Outer});
  detection.setDisabledElements(scene.floor, std::vector<std::uint32_t>{1, 5, 9});
  scene.move(0);
  detection.detectCollision();
  detection.advance();
  scene.move(1);
  // A capture holds positions in the world, where leaves differ, and no field.
  detection.setTransform(scene.bone, {});
  detection.removeGeometry(scene.field);
  detection.detectCollision();
  EXPECT_GT(detection.statistics().contacts, 50u);
  EXPECT_TRUE(detection.auditFailures().empty());
  expectSame(testing::replayed(detection).problem(), detection.problem());
  // The file does not contain a predicate, but says that there was one. The audit calls it.
  detection.setContactPredicate(scene.organ, scene.floor,
                                [](const ContactFeatures& f) { return f.a[0] % 2 == 0; });
  detection.detectCollision();
  EXPECT_TRUE(detection.auditFailures().empty());
  capture(detection, file());
  const CollisionProblem refused = readCapture(file());
  for (std::size_t i = 0; i < refused.pairs.size(); ++i)
    EXPECT_EQ(refused.pairs[i].predicate, i == 0);
}

TEST_F(Capture, KeepsThePairOfAnAuditFailure) {
  const OctreeBasedCD detection = movedScene();
  const GeometryId a{1}, b{2};
  for (const auto& [first, second] : {std::pair(b, a), std::pair(a, a)}) {
    capture(detection, {.a = first, .b = second}, file());
    EXPECT_EQ(m_folder.fileCount(), 1u);
    const CollisionProblem problem = readCapture(file());
    ASSERT_EQ(problem.pairs.size(), 1u);
    const auto [i, j] = std::pair(problem.pairs[0].a, problem.pairs[0].b);
    EXPECT_EQ(problem.geometries[i].id, first);
    EXPECT_EQ(problem.geometries[j].id, second);
    EXPECT_EQ(problem.geometries.size(), first == second ? 1u : 2u);
    OctreeBasedCD replay = setUp(problem);
    replay.detectCollision();
    EXPECT_EQ(replay.collisionData(GeometryId{i}, GeometryId{j}).hash(),
              detection.collisionData(first, second).hash());
  }
}

CollisionProblem smallProblem() {
  constexpr double kMin = std::numeric_limits<double>::denorm_min(), kMax = kLargestMeasure;
  CollisionProblem problem;
  problem.geometries = {{GeometryId{5},
                         {{0, 0, 0}, {1, 0, 0}, {0, 1, -0.0}},
                         {{0.1, 0, 0}, {1, 0, 0}, {0, 1, 1e-300}},
                         {{0, 1, 2}}},
                        {GeometryId{8},
                         {{kMin, -kMin, 0}, {-3, 0, 0}, {0, 1, 1}},
                         {{0, 0, 0}, {1, 0, 0}, {0, -kMax, 1.0 / 3}},
                         {{2, 1, 0}}},
                        {GeometryId{9}, {}, {}, {}}};
  problem.pairs = {{0, 1, {.thickness = 0.1}, Method::Proximity},
                   {1, 1, {.method = Method::Intersection}, Method::Intersection}};
  return problem;
}

TEST_F(Capture, KeepsEveryBit) {
  writeCapture(smallProblem(), file());
  const CollisionProblem read = readCapture(file());
  expectSame(read, smallProblem());
  EXPECT_TRUE(std::signbit(read.geometries[0].before[2][2]));
  writeCapture(CollisionProblem(), file());
  expectSame(readCapture(file()), CollisionProblem());
}

/// A problem places no body that nobody placed: a body that moves has no pair with itself.
TEST_F(Capture, AProblemKeepsAMeshWithAFieldAndAPairWithItself) {
  const testing::Mesh box = testing::cube(0, 1);
  OctreeBasedCD collisions;
  const GeometryId id = testing::addMesh(collisions, box);
  collisions.attachDistanceField(
      id, std::make_shared<const DistanceField>(DistanceField::build(
              {box.positions, box.triangles}, {.errorBound = 0.05, .band = 0.2, .threads = 1})));
  collisions.addCollisionPair(id, id, {.thickness = 0.1});
  collisions.detectCollision();
  OctreeBasedCD again = setUp(collisions.problem());
  again.detectCollision();
  EXPECT_EQ(again.collisionData(GeometryId{0}, GeometryId{0}).hash(),
            collisions.collisionData(id, id).hash());
}

TEST_F(Capture, ErrorsNameTheFault) {
  expectRefused("cannot be read");
  fs::create_directory(file());
  expectRefused("cannot be read");
  fs::remove(file());

  writeCapture(smallProblem(), file());
  const std::string whole = testing::contentOf(file());
  const auto expectRefusedWith = [&](const std::string& from, const std::string& to,
                                     const std::string& reason) {
    std::string text = whole;
    const std::size_t place = text.find(from);
    ASSERT_NE(place, text.npos) << from;
    write(text.replace(place, from.size(), to));
    expectRefused(reason);
  };
  expectRefusedWith("palpate-capture 14", "solid 3", "it is not a capture");
  expectRefusedWith("palpate-capture 14", "palpate-capture 15",
                    "its version is 15; versions up to 14");
  expectRefusedWith("palpate-capture 14", "palpate-capture x", "line 1: \"x\" is not an integer");
  expectRefusedWith("0 1 2\n", "0 1 3\n", "vertex index 3 is out of range");
  expectRefusedWith("0 1 2\n", "0 1 -2\n", "line 8: \"-2\" is not an integer");
  expectRefusedWith("0 1 2\n", "0 1 99999999999\n", "is not an integer in range");
  expectRefusedWith("0p+0 0p+0 0p+0 ", "nan 0p+0 0p+0 ", "geometry 0, vertex 0: position before");
  expectRefusedWith("0 1 2\n", "0 1\n", "");
  expectRefusedWith("pair 0 1 ", "pair 0 7 ", "geometry 7 was never added");
  expectRefusedWith("pair 1 1 ", "pair 1 0 ", "was added before");
  expectRefusedWith("pair 1 1 ", "twin 1 1 ", "found \"twin\", expected \"pair\"");
  expectRefusedWith("Proximity", "Guess", "\"Guess\" is not a known name");
  expectRefusedWith("geometry 5 3 1", "geometry 5 333333 1", "the file is truncated");
  expectRefusedWith("geometry 5 3 1", "geometry 5 4 1", "");
  expectRefusedWith("Octree 0 32", "Octree 0 61", "octree.maxDepth is 61");
  expectRefusedWith("end\n", "end\nend\n", "there is text after the end");
  write(whole);
  EXPECT_NO_THROW(readCapture(file()));
  ASSERT_TRUE(whole.ends_with("end\n"));
  for (std::size_t size = 0; size + 1 < whole.size(); size += 2) {
    write(whole.substr(0, size));
    EXPECT_THROW(readCapture(file()), Error) << size;
  }
  write(whole.substr(0, whole.size() / 2));
  expectRefused("line ");
  write(whole.substr(0, whole.size() - 5));
  expectRefused("the file is truncated");
  write("");
  expectRefused("it is not a capture");
}

/// Counts are checked against the characters that follow, before memory is taken for them.
TEST_F(Capture, RefusesCountsThatDoNotFitIntoTheFile) {
  constexpr std::size_t kSize = 1'000'000;
  const std::string start = "palpate-capture 9\nOctree 0 32 8 Auto\n", filling(kSize, ' ');
  const std::string mesh = "geometry 0 ";
  for (const std::string& counts :
       {std::string("999999 0"), std::string("0 999999"), "1 0 " + mesh + "999999 0 Triangles",
        "1 0 " + mesh + "0 999999 Triangles", "1 0 " + mesh + "0 0 Lines 999999",
        "1 0 " + mesh + "0 0 Shape 0 ConvexHull 999999"}) {
    write(start + counts + " " + filling);
    FailingAllocation::arm(0);
    EXPECT_THROW(readCapture(file()), Error) << counts;
    FailingAllocation::disarm();
    EXPECT_LE(FailingAllocation::peakBytes(), 20 * kSize) << counts;
  }
  write(start + std::string(kSize, 'x'));
  try {
    readCapture(file());
    ADD_FAILURE();
  } catch (const Error& error) {
    EXPECT_LT(std::string(error.what()).size(), 500u);
  }
}

TEST_F(Capture, ReadsEarlierVersions) {
  writeCapture(smallProblem(), file());
  std::string text = testing::contentOf(file());
  const auto replaceAll = [&](const std::string& words, const std::string& with) {
    ASSERT_NE(text.find(words), text.npos) << words;
    for (std::size_t at; (at = text.find(words)) != text.npos;)
      text.replace(at, words.size(), with);
  };
  const auto asVersion = [&](int version) {
    text.replace(0, text.find('\n'), "palpate-capture " + std::to_string(version));
    write(text);
    return readCapture(file());
  };
  replaceAll(" Both 0 0 0 0 0 0\n", " Both 0 0 0\n");  // tags, removed, removedTetrahedra
  replaceAll(" 1.0c6f7a0b5ed8dp-20 0 0p+0 1p-2 0p+0 0 0 0 0 0 0\n",
             " 1.0c6f7a0b5ed8dp-20 0 0p+0 1p-2 0p+0 0 0\n");  // priority to sides
  EXPECT_TRUE(asVersion(13).geometries[0].tags.empty());
  EXPECT_EQ(asVersion(13).pairs[0].settings.priority, 0);
  EXPECT_FALSE(asVersion(13).pairs[0].settings.smoothNormals);
  EXPECT_FALSE(asVersion(13).pairs[0].settings.rememberSides);
  replaceAll(" 1.0c6f7a0b5ed8dp-20 0 0p+0 1p-2 0p+0 0 0\n",
             " 1.0c6f7a0b5ed8dp-20 0 0p+0 1p-2 0p+0\n");  // trackContacts, reportCrossings
  EXPECT_FALSE(asVersion(12).pairs[0].settings.trackContacts);
  EXPECT_FALSE(asVersion(12).pairs[0].settings.reportCrossings);
  replaceAll(" 1.0c6f7a0b5ed8dp-20 0 0p+0 1p-2 0p+0\n",
             " 1.0c6f7a0b5ed8dp-20 0 0p+0 1p-2\n");  // freeMotionReach
  EXPECT_EQ(asVersion(11).pairs[0].settings.freeMotionReach, 0.0);
  replaceAll(" 1.0c6f7a0b5ed8dp-20 0 0p+0 1p-2\n",
             " 1.0c6f7a0b5ed8dp-20 0\n");  // allowedError, widestNormalCone
  EXPECT_EQ(asVersion(10).pairs[0].settings.allowedError, 0.0);
  EXPECT_EQ(asVersion(10).pairs[0].settings.proxy.widestNormalCone,
            PairSettings().proxy.widestNormalCone);
  replaceAll(" Auto Box\n", " Auto\n");  // bounds
  EXPECT_EQ(asVersion(9).settings.octree.bounds, OctreeBounds::Box);
  replaceAll(" 1.0c6f7a0b5ed8dp-20 0\n", " 1.0c6f7a0b5ed8dp-20\n");  // earliestTimeOnly
  const std::string version8 = text;
  EXPECT_FALSE(asVersion(8).pairs[0].settings.continuous.earliestTimeOnly);
  text = version8;
  const std::string pair = "pair 0 1 Auto Proximity 1.999999999999ap-4 ";
  replaceAll(pair + "Distinct", "pair 0 1 Continuous Continuous 1.999999999999ap-4 Earliest");
  EXPECT_TRUE(asVersion(8).pairs[0].settings.continuous.earliestTimeOnly);
  text = version8;
  replaceAll(" Both 0 0 0\n", " Both 0 0\n");  // tetrahedra
  replaceAll(" 1.0c6f7a0b5ed8dp-20\n", "\n");  // timeTolerance
  EXPECT_EQ(asVersion(5).pairs[0].settings.continuous.timeTolerance,
            PairSettings().continuous.timeTolerance);
  replaceAll(" 0 1 4294967295 Both 0 0\n", " 0\n");  // filters, rest
  replaceAll(" 0p+0 0\n", " 0p+0\n");                // predicate
  EXPECT_EQ(asVersion(3).geometries[0].filter, CollisionFilter());
  replaceAll(" Triangles 0\n", "\n");
  replaceAll(" -1p+0 0p+0\n", " -1p+0\n");  // restDistance
  EXPECT_EQ(asVersion(2).pairs[0].settings.method, smallProblem().pairs[0].settings.method);
  replaceAll(" -1p+0\n", "\n");  // tolerance
  const CollisionProblem read = asVersion(1);
  EXPECT_EQ(read.pairs[0].settings.method, Method::Proximity);  // methods that Auto chose
  EXPECT_EQ(read.pairs[0].settings.automatic.motionTolerance,
            PairSettings().automatic.motionTolerance);
}

/// Nothing is written that cannot be read.
TEST_F(Capture, RefusesWhatIsOutsideTheRange) {
  const auto expectNotWritten = [&](const CollisionProblem& problem, ErrorCode code) {
    testing::expectRefused(code, "", [&] { writeCapture(problem, file()); });
    EXPECT_EQ(m_folder.fileCount(), 0u);
  };
  CollisionProblem problem;
  for (const double bad :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(), 1e301}) {
    problem = smallProblem();
    problem.geometries[1].now[2][0] = bad;
    expectNotWritten(problem, ErrorCode::NonFinitePosition);
    problem = smallProblem();
    problem.pairs[0].settings.thickness = bad;
    expectNotWritten(problem, ErrorCode::InvalidSettings);
  }
  problem = smallProblem();
  problem.geometries[1].now[2][0] = 0x1.8p-7;
  problem.pairs[0].settings.thickness = 0x1.8p-9;
  writeCapture(problem, file());
  const std::string whole = testing::contentOf(file());
  for (const std::string bad : {"nan", "inf", "1p+997"})
    for (const auto& [from, reason] : {std::pair("1.8p-7", "geometry 1, vertex 2: position is"),
                                       std::pair("1.8p-9", "thickness is")}) {
      std::string text = whole;
      write(text.replace(text.find(from), std::string(from).size(), bad));
      expectRefused(reason);
    }
}

/// Captures hold positions in the world.
TEST_F(Capture, RefusesBodiesPlacedOutsideTheRange) {
  OctreeBasedCD detection;
  const GeometryId point =
      detection.addPointSet(std::vector<Eigen::Vector3d>{{kLargestMeasure, 0, 0}});
  detection.setTransform(point, {.translation = {kLargestMeasure, 0, 0}});
  EXPECT_THROW(capture(detection, file()), Error);
  detection.setTransform(point, {.translation = {-kLargestMeasure, 0, 0}});
  detection.advance();
  capture(detection, file());
  EXPECT_EQ(readCapture(file()).geometries[0].now[0], Eigen::Vector3d(0, 0, 0));
}

TEST_F(Capture, LeavesNoPartialFile) {
  const fs::path nowhere = m_folder.path / "missing" / "file.capture";
  EXPECT_THROW(writeCapture(smallProblem(), nowhere), Error);
  EXPECT_EQ(m_folder.fileCount(), 0u);
  // A folder has the file's name, so the rename fails.
  fs::create_directories(file() / "full");
  testing::expectRefused(ErrorCode::File, file().string(),
                         [&] { writeCapture(smallProblem(), file()); });
  EXPECT_EQ(m_folder.fileCount(), 1u);
  // The disk is full after a part: the existing file stays.
  if (!fs::exists("/dev/full")) GTEST_SKIP() << "no /dev/full";
  writeCapture(CollisionProblem(), file("kept.capture"));
  fs::create_symlink("/dev/full", file("kept.capture.part"));
  EXPECT_THROW(writeCapture(smallProblem(), file("kept.capture")), Error);
  EXPECT_TRUE(readCapture(file("kept.capture")).geometries.empty());
  EXPECT_EQ(m_folder.fileCount(), 2u);
}

}  // namespace
}  // namespace palpate
