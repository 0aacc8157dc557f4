#include <palpate/OctreeBasedCD.h>
#include <palpate/ThreadTopology.h>

#include "Core/Archive.h"
#include "Common/Answers.h"
#include "Common/ExpectRefused.h"
#include "Common/FailingAllocation.h"
#include "Common/RandomMeshes.h"
#include "Common/Sanitized.h"
#include "Common/WholeScene.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cstring>
#include <functional>
#include <vector>

// OctreeBasedCD::save() and restore(): what histories (Common/History.h) do not restore.

namespace palpate {
namespace {

using testing::Answers;
using testing::FailingAllocation;
using testing::Mesh;
using testing::Positions;
using testing::Random;
using Bytes = std::vector<std::byte>;

/// A sheet sinks through another one, with all that lasts from step to step.
class Sheets {
 public:
  explicit Sheets(std::uint32_t n = 6) : m_low(testing::sheet(n, 0.0, 0)), m_high(m_low) {
    for (Vector3d& p : m_high.positions) p += Vector3d(0.03, 0.02, 0.05);
    low = detection.addTriangleMesh(m_low.positions, m_low.triangles);
    high = detection.addTriangleMesh(m_high.positions, m_high.triangles);
    ball = detection.addAnalyticalGeometry(Sphere{{0, 0, 0}, 0.2});
    detection.addCollisionPair(high, low,
                               {.method = Method::Continuous,
                                .thickness = 0.02,
                                .freeMotionReach = 0.1,
                                .trackContacts = true,
                                .reportCrossings = true,
                                .smoothNormals = true,
                                .rememberSides = true});
    detection.addCollisionPair(high, high, {.method = Method::Continuous, .restDistance = 0.3});
    detection.addCollisionPair(low, ball, {.thickness = 0.05, .trackContacts = true});
    detection.setTags(low, std::vector<std::uint32_t>(m_low.triangles.size(), 7));
    detection.setName(low, "tissue");
  }

  /// Moves everything and detects. The step that follows depends on the number alone.
  void frame(int number) {
    Positions now = m_high.positions;
    const double depth = 0.12 * std::sin(0.8 * number);
    for (Vector3d& p : now)
      p -= Vector3d(0.015 * number, 0, depth + 0.01 * std::cos(number + 5 * p[0]));
    now.resize(detection.vertexCount(high), Vector3d(2, 2, 2));
    detection.setPositions(high, now);
    const Eigen::Matrix3d turn =
        Eigen::AngleAxisd(0.3 * number, Vector3d(1, 2, 3).normalized()).toRotationMatrix();
    detection.setTransform(ball, {turn, {0.5, 0.5, 0.22 + 0.03 * std::sin(number)}});
    if (number % 5 == 3) {
      detection.detectCollision(std::chrono::microseconds(0));  // no time for anything
    } else {
      detection.detectCollision();
      mark(number);
    }
  }
  void advance() { detection.advance(); }

  /// A cut, and other changes that restore() must undo.
  void change() {
    detection.replaceTriangles(high, std::vector<std::uint32_t>{1, 4},
                               std::vector<Triangle>{{0, 2, 8}}, {});
    detection.setDisabledElements(low, std::vector<std::uint32_t>{0, 3});
    detection.setTags(low, {});
    detection.setName(low, "cut");
    detection.removeCollisionPair(low, ball);
    detection.removeCollisionPair(high, high);
    detection.setTransform(high, {});  // a pair with itself would forbid it
  }

  OctreeBasedCD detection{Settings{.threads = 1}};
  GeometryId low, high, ball;

 private:
  using Vector3d = Eigen::Vector3d;
  void mark(int number) {
    std::vector<TrackedContact> all;
    const CollisionData& data = detection.collisionData(high, low);
    all.assign(data.trackedVertexTriangle().begin(), data.trackedVertexTriangle().end());
    for (const TrackedContact& contact : all)
      detection.setUserData(high, low, contact.key,
                            contact.userData + static_cast<std::uint64_t>(number) + 1);
  }

  Mesh m_low, m_high;
};

/// The answers of `frames` frames.
std::vector<Answers> run(Sheets& sheets, int first, int frames) {
  std::vector<Answers> answers;
  for (int i = first; i < first + frames; ++i) {
    sheets.frame(i);
    answers.emplace_back(sheets.detection);
    sheets.advance();
  }
  return answers;
}

void expectSame(const std::vector<Answers>& l, const std::vector<Answers>& r) {
  ASSERT_EQ(l.size(), r.size());
  for (std::size_t i = 0; i < l.size(); ++i) {
    SCOPED_TRACE(::testing::Message() << "frame " << i);
    testing::expectSame(l[i], r[i]);
  }
}

/// Geometries of every type and pairs of every method, with fields and leaves.
TEST(SavedState, KeepsEveryGeometryTypeAndMethod) {
  const testing::WholeSceneInput input(4);
  testing::WholeScene scene(input, {.threads = 1}), other(input, {.threads = 2});
  const auto run = [](testing::WholeScene& s, int first) {
    std::vector<Answers> answers;
    for (int i = first; i < first + 3; ++i) {
      s.move(i);
      s.detection.detectCollision();
      answers.emplace_back(s.detection);
      s.detection.advance();
    }
    return answers;
  };
  run(scene, 0);
  const Bytes state = scene.detection.save();
  const std::vector<Answers> truth = run(scene, 3);
  scene.detection.restore(state);
  expectSame(run(scene, 3), truth);
  other.move(9);
  other.detection.restore(state);
  expectSame(run(other, 3), truth);

  // Snapshots and queries are those of the restored geometries.
  scene.detection.publish();
  other.detection.restore(state);
  scene.detection.restore(state);
  scene.detection.publish();
  const auto nearest = [&](const SpatialQueries& queries) {
    return queries.closestPoint(scene.organ, {0.1, 0.2, 2})->distance;
  };
  EXPECT_EQ(nearest(scene.detection.queries()), nearest(other.detection.queries()));
  EXPECT_EQ(nearest(scene.detection.latestSnapshot()->queries()),
            nearest(scene.detection.queries()));

  // A new object has neither the fields nor the ids.
  OctreeBasedCD empty;
  testing::expectRefused(ErrorCode::NotAvailable, "distance field", [&] { empty.restore(state); });
  EXPECT_TRUE(empty.pairs().empty());
}

TEST(SavedState, PredicatesAreThoseOfTheObject) {
  Sheets sheets;
  sheets.frame(1);
  const Bytes without = sheets.detection.save();
  sheets.detection.setContactPredicate(sheets.high, sheets.low,
                                       [](const ContactFeatures& f) { return f.a[0] % 2 == 0; });
  const Bytes with = sheets.detection.save();
  const std::vector<Answers> truth = run(sheets, 3, 4);
  sheets.detection.restore(with);
  expectSame(run(sheets, 3, 4), truth);
  sheets.detection.restore(without);
  testing::expectRefused(ErrorCode::NotAvailable, "predicate",
                         [&] { sheets.detection.restore(with); });
  EXPECT_TRUE(sheets.detection.save() == without);
}

Bytes withChecksum(Bytes bytes) {
  const std::size_t end = bytes.size() - 8;
  const std::uint64_t sum = archiveChecksum(std::span(bytes).first(end));
  std::memcpy(bytes.data() + end, &sum, 8);
  return bytes;
}

/// Restores bytes that may be anything. Returns whether they were refused, with nothing changed.
bool isRefused(OctreeBasedCD& detection, const Bytes& before, const Bytes& bytes) {
  try {
    detection.restore(bytes);
  } catch (const Error& error) {
    EXPECT_TRUE(error.code() == ErrorCode::File || error.code() == ErrorCode::NotAvailable)
        << error.what();
    EXPECT_NE(std::string(error.what()).find("saved state"), std::string::npos) << error.what();
    EXPECT_TRUE(detection.save() == before);
    return true;
  }
  return false;
}

TEST(SavedState, TruncatedAndForeignBytesAreRefused) {
  Sheets sheets(2);
  run(sheets, 0, 4);
  const Bytes state = sheets.detection.save();
  for (std::size_t size = 0; size < state.size(); ++size) {
    if (testing::isLeftOut(size)) continue;
    Bytes part(state.begin(), state.begin() + static_cast<std::ptrdiff_t>(size));
    EXPECT_TRUE(isRefused(sheets.detection, state, part)) << size;
    if (size >= 28) {
      EXPECT_TRUE(isRefused(sheets.detection, state, withChecksum(part))) << size;
    }
  }
  Bytes longer = state;
  longer.insert(longer.end() - 8, std::byte{0});
  EXPECT_TRUE(isRefused(sheets.detection, state, withChecksum(longer)));
  ThreadTopology threads(sheets.detection);
  EXPECT_TRUE(isRefused(sheets.detection, state, threads.save()));
}

/// A wrong checksum is refused. With a right one, what is accepted is a state like any other.
TEST(SavedState, ChangedBytesAreRefusedOrAState) {
  Sheets sheets(2);
  run(sheets, 0, 9);
  sheets.frame(9);
  const Bytes state = sheets.detection.save();
  Random random(5);
  std::size_t accepted = 0, refused = 0;
  for (int i = 0; i < testing::casesOf(6000); ++i) {
    Bytes changed = state;
    for (auto flips = 1 + random() % 3; flips > 0; --flips) {
      std::byte& byte = changed[random() % (changed.size() - 8)];
      const unsigned kind = random() % 4;
      byte = kind == 0   ? static_cast<std::byte>(random() % 256)
             : kind == 1 ? std::byte{0xff}
                         : byte ^ static_cast<std::byte>(1u << random() % 8);
    }
    if (changed == state) continue;
    EXPECT_TRUE(isRefused(sheets.detection, state, changed)) << i;
    if (isRefused(sheets.detection, state, withChecksum(changed))) {
      ++refused;
      continue;
    }
    ++accepted;
    EXPECT_FALSE(isRefused(sheets.detection, state, sheets.detection.save()));
    sheets.detection.detectCollision();
    sheets.detection.advance();
    sheets.detection.detectCollision();
    sheets.detection.restore(state);
    ASSERT_TRUE(sheets.detection.save() == state) << i;
  }
  EXPECT_GE(accepted, testing::leastOf(500));
  EXPECT_GE(refused, testing::leastOf(500));
}

/// The buffer of a state has the size of the last one and a little more, so that it does not grow.
TEST(SavedState, ExpectsTheSizeOfTheLastOne) {
  Sheets sheets(20);
  run(sheets, 0, 3);
  const Bytes first = sheets.detection.save(), second = sheets.detection.save();
  EXPECT_EQ(first, second);
  EXPECT_GT(first.size(), 50'000u);
  EXPECT_LE(second.capacity(), first.size() + first.size() / 16);
}

TEST(SavedState, NumbersAreWrittenTogetherAsOneByOne) {
  const std::vector<double> reals{0.0, -1.5, 1e300, 0x1p-1074}, none;
  const std::vector<Triangle> triangles{{1, 2, 3}, {4, 5, 6}};
  const auto bytesOf = [](auto&& write) {
    ArchiveWriter file("numbers", 1);
    write(file);
    return file.bytes();
  };
  EXPECT_EQ(bytesOf([&](auto& file) {
              description::fieldOf(file, reals);
              description::fieldOf(file, triangles);
              description::fieldOf(file, none);
            }),
            bytesOf([&](auto& file) {
              for (const double value : reals) file.real(value);
              for (const Triangle& triangle : triangles)
                for (const std::uint32_t id : triangle) file.integer(id);
            }));
}

TEST(SavedState, FailingAllocationsChangeNothing) {
  Sheets sheets(2);
  run(sheets, 0, 4);
  const Bytes state = sheets.detection.save();
  sheets.change();
  run(sheets, 4, 2);
  const Bytes before = sheets.detection.save();
  std::size_t n = 1;
  while (FailingAllocation::throwsAt(n, [&] { sheets.detection.restore(state); })) {
    ASSERT_TRUE(sheets.detection.save() == before) << n;
    n += testing::kShareOfCases;
  }
  EXPECT_GT(n, 100u);
  EXPECT_TRUE(sheets.detection.save() == state);
}

/// A thread through a hole and beside another one, which is torn: frames after restore() are those
/// of histories. Changed bytes are refused or a state.
TEST(SavedState, ThreadTopologyIsRestoredBesideIt) {
  const Positions at{{0.2, 0.2, 1}, {0.2, 0.2, 0.5}, {0.2, 0.2, 5}},
      square{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
  OctreeBasedCD detection;
  const GeometryId thread = detection.addLineMesh(at, std::vector<Segment>{{0, 1}, {1, 2}}),
                   hole = detection.addTriangleMesh(square,
                                                    std::vector<Triangle>{{0, 1, 2}, {0, 2, 3}}),
                   other = detection.addLineMesh(Positions{{-1, -1, 0.4}, {1, -1, 0.4}},
                                                 std::vector<Segment>{{0, 1}});
  ThreadTopology topology(detection);
  topology.add({thread, {0, 1, 2}}, {hole, {0, 1, 2, 3}});
  topology.addParts({thread, {1, 2}}, {other, {0, 1}});
  topology.add({other, {0, 1}}, {hole, {0, 1, 2, 3}});
  detection.advance();
  topology.update();
  const Bytes ofThreads = topology.save();
  Positions now = at;
  for (int v = 0; v < 2; ++v) now[v][2] -= 1.5;
  detection.setPositions(thread, now);
  detection.setDisabledElements(other, std::vector<std::uint32_t>{0});
  topology.update();
  EXPECT_NE(topology.count(0), 0);
  EXPECT_TRUE(topology.isLost(2));
  const Bytes last = topology.save();
  topology.restore(ofThreads);
  EXPECT_EQ(topology.count(0), 0);
  EXPECT_FALSE(topology.isLost(2));
  topology.restore(last);
  for (std::size_t i = 0; i < ofThreads.size() - 8; ++i) {
    Bytes changed = ofThreads;
    changed[i] ^= std::byte{0xff};
    EXPECT_THROW(topology.restore(changed), Error);
    try {
      topology.restore(withChecksum(changed));
      topology.update();
      topology.restore(last);
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::File) << error.what();
    }
    ASSERT_TRUE(topology.save() == last) << i;
  }
}

}  // namespace
}  // namespace palpate
