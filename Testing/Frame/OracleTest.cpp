#include "Common/ObjText.h"
#include "Common/PairRun.h"
#include "Common/Sanitized.h"
#include "Common/DegenerateCases.h"

#include <gtest/gtest.h>

#include <filesystem>

// Whole sets of contacts of published meshes, octrees against brute force, by every method, frame
// after frame. ContactLawTest.cpp has touching, folded and flat ones, and
// SupportedPairsTest.cpp soups and sheets.

namespace palpate {
namespace {

using namespace testing;
using Eigen::Vector3d;

/// Two frames, in the second of which the meshes have drifted and their vertices are shaken, by
/// parts of a length. Returns the number of frames with contacts of a and b.
std::size_t compare(const Mesh& a, const Mesh& b, const PairSettings& settings, double length,
                    bool withThemselves) {
  const Settings octrees[] = {settingsOf(Engine::Octree, 1),
                              settingsOf(Engine::Octree, 2, OctreeUpdate::Rebuild)};
  PairRun oracle(settingsOf(Engine::BruteForce), a, b, settings, withThemselves),
      runs[] = {{octrees[0], a, b, settings, withThemselves},
                {octrees[1], a, b, settings, withThemselves}};
  Random random(5);
  std::vector<Vector3d> aNow = a.positions, bNow = b.positions;
  std::size_t met = 0;
  for (const bool isMoved : {false, true}) {
    SCOPED_TRACE(isMoved ? "moved" : "at rest");
    const std::vector<Vector3d> aBefore = aNow, bBefore = bNow;
    for (auto* now : {&aNow, &bNow}) {
      const Vector3d drift = randomPoint(random, -0.02, 0.02) * length;
      for (Vector3d& p : *now)
        if (isMoved) p += drift + randomPoint(random, -0.003, 0.003) * length;
    }
    oracle.step(aBefore, aNow, bBefore, bNow);
    oracle.expectWellFormed(a, b);
    met += oracle.data().earliestTimeOfImpact() <= 1;
    for (const int i : {0, 1}) {
      SCOPED_TRACE(nameOf(octrees[i]));
      runs[i].step(aBefore, aNow, bBefore, bNow);
      expectSame(runs[i].answers(), oracle.answers());
    }
  }
  return met;
}

/// The triangles nearest to a position, with vertices of their own.
Mesh patch(const Mesh& mesh, const Vector3d& centre, std::size_t count) {
  std::vector<std::uint32_t> order(mesh.triangles.size());
  for (std::uint32_t t = 0; t < order.size(); ++t) order[t] = t;
  count = std::min(count, order.size());
  const auto away = [&](std::uint32_t t) {
    return (mesh.positions[mesh.triangles[t][0]] - centre).squaredNorm();
  };
  std::nth_element(order.begin(), order.begin() + static_cast<std::ptrdiff_t>(count) - 1,
                   order.end(), [&](auto s, auto t) { return away(s) < away(t); });
  Mesh out;
  std::vector<std::uint32_t> ids(mesh.positions.size(), ~0u);
  for (std::size_t i = 0; i < count; ++i) {
    Triangle triangle = mesh.triangles[order[i]];
    for (std::uint32_t& corner : triangle) {
      std::uint32_t& id = ids[corner];
      if (id == ~0u) {
        id = static_cast<std::uint32_t>(out.positions.size());
        out.positions.push_back(mesh.positions[corner]);
      }
      corner = id;
    }
    out.triangles.push_back(triangle);
  }
  return out;
}

double meanEdge(const Mesh& mesh) {
  double sum = 0;
  for (const auto& [a, b, c] : mesh.triangles)
    sum += (mesh.positions[a] - mesh.positions[b]).norm();
  return sum / static_cast<double>(mesh.triangles.size());
}

Mesh shaken(Mesh mesh, double by) {
  Random random(8);
  for (Vector3d& p : mesh.positions) p += randomPoint(random, -by, by);
  return mesh;
}

class Oracle : public ::testing::TestWithParam<MethodCase> {};

/// Each whole mesh against a piece cut out of it and shaken, and a larger such piece with itself.
TEST_P(Oracle, AgreesOnPublishedMeshes) {
  const std::filesystem::path folder = std::filesystem::path(PALPATE_SHARED_DATA) / "meshes";
  if (!std::filesystem::is_directory(folder)) GTEST_SKIP() << folder << " is absent";
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(folder))
    if (entry.path().extension() == ".obj") files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  ASSERT_FALSE(files.empty());
  for (std::size_t i = 0; i < files.size(); ++i) {
    if (isLeftOut(i)) continue;
    const std::filesystem::path& file = files[i];
    SCOPED_TRACE(file.filename());
    const Mesh mesh = readObj(file);
    const Vector3d centre = mesh.positions[mesh.positions.size() / 3];
    const Mesh cut = patch(mesh, centre, 50);
    const double edge = meanEdge(cut);
    const Mesh piece = shaken(cut, 0.3 * edge);
    PairSettings settings = GetParam().settings;
    settings.thickness *= 0.2 * edge;
    EXPECT_GT(compare(mesh, piece, settings, edge, false), 0u);
    const Mesh crumpled = shaken(patch(mesh, centre, 300), edge);
    EXPECT_GT(compare(crumpled, piece, settings, edge, true), 0u);
  }
}

INSTANTIATE_TEST_SUITE_P(EveryMethod, Oracle, ::testing::ValuesIn(methodCases(1.0)),
                         [](const auto& method) { return method.param.name; });

}  // namespace
}  // namespace palpate
