#include <palpate/Capture.h>
#include <palpate/OctreeBasedCD.h>

#include "Common/ExpectRefused.h"
#include "Common/RandomMeshes.h"
#include "Common/TemporaryFolder.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <set>
#include <string>

// Whole frames with a planted fault: the failures that the audit lists, and the files that it
// writes.

namespace palpate {
namespace {

namespace fs = std::filesystem;
using testing::Mesh;

/// Overwrites triangle ids in the octree's memory, as a bug could: from then on, the first triangle
/// of each node counts as another one.
void corrupt(const OctreeBasedCD& detection, GeometryId geometry) {
  const LooseOctree& octree = detection.octree();
  for (const LooseOctree::Node& node : octree.nodes(geometry))
    if (node.elements.size() > 1) const_cast<std::uint32_t&>(node.elements[0]) = node.elements[1];
  ASSERT_FALSE(octree.validate().empty());
}

class AuditFiles : public ::testing::Test {
 protected:
  const testing::TemporaryFolder m_temporary;
  const fs::path& m_folder = m_temporary.path;
  const GeometryId m_a{0}, m_b{1};
  Mesh m_meshes[2] = {testing::sheet(12, 0.0, 0.0), testing::sheet(11, 0.01, 1.0)};

  void SetUp() override {
#ifdef PALPATE_VALIDATE
    GTEST_SKIP() << "octrees are validated here, which finds the planted fault first";
#endif
  }

  OctreeBasedCD detection(AuditSettings audit) const {
    OctreeBasedCD detection({.threads = 1, .audit = std::move(audit)});
    for (const Mesh& mesh : m_meshes) detection.addTriangleMesh(mesh.positions, mesh.triangles);
    detection.addCollisionPair(
        m_a, m_b, {.method = Method::Proximity, .thickness = 0.02, .contacts = Contacts::All});
    detection.addCollisionPair(m_a, m_a, {.method = Method::Intersection});
    return detection;
  }
  AuditSettings everything() const { return {.features = 1 << 20, .folder = m_folder}; }
  /// A frame in which the octree of the second mesh is wrong.
  void faultyFrame(OctreeBasedCD& detection) {
    m_meshes[1].positions[0].z() += 0.001;
    detection.setPositions(m_b, m_meshes[1].positions);
    detection.update();
    corrupt(detection, m_b);
    detection.detectCollision();
    detection.advance();
  }
};

TEST_F(AuditFiles, FaultIsListedAndWrittenToAFileThatReplaysIt) {
  OctreeBasedCD faulty = detection(everything());
  faulty.detectCollision();
  EXPECT_TRUE(faulty.auditFailures().empty());
  EXPECT_EQ(m_temporary.fileCount(), 0u);
  const std::size_t contacts = faulty.collisionData(m_a, m_b).vertexTriangle().size();
  EXPECT_GT(contacts, 20u);
  faultyFrame(faulty);

  const std::span<const AuditFailure> failures = faulty.auditFailures();
  ASSERT_GT(failures.size(), 10u);
  const fs::path file = m_folder / "frame2-pair0-1.capture";
  std::set<AuditFailure::List> lists;
  for (const AuditFailure& failure : failures) {
    EXPECT_EQ(failure.a, m_a);
    EXPECT_EQ(failure.b, m_b);
    EXPECT_EQ(failure.frame, 2u);
    EXPECT_EQ(failure.file, file);
    EXPECT_EQ(failure.fileError, "");
    lists.insert(failure.list);
  }
  EXPECT_EQ(lists.size(), 3u);
  EXPECT_EQ(m_temporary.fileCount(), 1u);

  // Without the fault, the file's problem has exactly the missing contacts.
  const CollisionProblem problem = readCapture(file);
  ASSERT_EQ(problem.pairs.size(), 1u);
  OctreeBasedCD replay = setUp(problem);
  replay.detectCollision();
  const auto expected = replay.collisionData(m_a, m_b).edgeEdge();
  for (const AuditFailure& failure : failures) {
    const auto* contact = std::get_if<EdgeEdgeContact>(&failure.expected);
    if (!contact) continue;
    EXPECT_NE(std::find(expected.begin(), expected.end(), *contact), expected.end());
  }

  // A rebuild repairs the octree.
  faulty.setTriangles(m_b, m_meshes[1].positions, m_meshes[1].triangles);
  faulty.detectCollision();
  EXPECT_TRUE(faulty.auditFailures().empty());
}

TEST_F(AuditFiles, ExistingFilesAreKeptAndNoneIsWrittenWithoutAFolder) {
  const fs::path first = m_folder / "frame1-pair0-1.capture",
                 second = m_folder / "frame1-pair0-1-2.capture";
  std::ofstream(first) << "precious";
  for (const bool hasFolder : {true, false}) {
    OctreeBasedCD faulty = detection(hasFolder ? everything() : AuditSettings{.features = 1 << 20});
    faultyFrame(faulty);
    ASSERT_FALSE(faulty.auditFailures().empty());
    for (const AuditFailure& failure : faulty.auditFailures()) {
      EXPECT_EQ(failure.file, hasFolder ? second : fs::path());
      EXPECT_EQ(failure.fileError, "");
    }
  }
  EXPECT_EQ(fs::file_size(first), 8u);
  EXPECT_NO_THROW(readCapture(second));
}

TEST_F(AuditFiles, AtMostMaxFilesAreWrittenAndARemovedFolderIsNamed) {
  AuditSettings settings = everything();
  settings.maxFiles = 2;
  OctreeBasedCD faulty = detection(settings);
  for (int frame = 1; frame <= 3; ++frame) {
    faultyFrame(faulty);
    ASSERT_FALSE(faulty.auditFailures().empty());
    EXPECT_EQ(faulty.auditFailures().front().file.empty(), frame == 3);
  }
  EXPECT_EQ(m_temporary.fileCount(), 2u);
  EXPECT_NE(faulty.auditFailures().front().fileError.find(m_folder.string()), std::string::npos);

  OctreeBasedCD homeless = detection(everything());
  fs::remove_all(m_folder);
  EXPECT_NO_THROW(faultyFrame(homeless));
  ASSERT_FALSE(homeless.auditFailures().empty());
  for (const AuditFailure& failure : homeless.auditFailures()) {
    EXPECT_TRUE(failure.file.empty());
    EXPECT_NE(failure.fileError.find((m_folder / "frame1-pair0-1.capture").string()),
              std::string::npos)
        << failure.fileError;
  }
}

TEST_F(AuditFiles, MissingFolderThrowsAnErrorThatNamesIt) {
  for (const fs::path& folder : {m_folder / "missing", fs::path("/dev/null")})
    testing::expectRefused(ErrorCode::InvalidSettings, folder.string(),
                           [&] { detection({.features = 1, .folder = folder}); });
  testing::expectRefused(ErrorCode::InvalidSettings, "audit.features is -1",
                         [&] { detection({.features = -1}); });
  EXPECT_THROW(detection({.features = 1, .maxFiles = -1}), Error);
}

}  // namespace
}  // namespace palpate
