#include "Common/ObjText.h"
#include "Common/PairRun.h"
#include "Common/Sanitized.h"
#include "Common/DegenerateCases.h"

#include <gtest/gtest.h>

#include <filesystem>

// Whole sets of contacts, octrees against brute force, by every method, frame after frame.

namespace palpate {
namespace {

using namespace testing;
using Eigen::Vector3d;

struct Pair {
  std::string name;
  Mesh a, b;
  double thickness;
};

/// Drifts a mesh and shakes its vertices.
class Motion {
 public:
  explicit Motion(double size) : m_size(size) {}
  void moveOn(std::vector<Vector3d>& positions) {
    const Vector3d drift = randomPoint(m_random, -0.02 * m_size, 0.02 * m_size);
    for (Vector3d& p : positions) p += drift + randomPoint(m_random, -0.003, 0.003) * m_size;
  }

 private:
  Random m_random{5};
  double m_size;
};

/// Returns the number of frames with contacts of a and b.
std::size_t compare(const Pair& pair, const PairSettings& settings,
                    const std::vector<Settings>& octrees, double size, int frames,
                    bool withThemselves = true) {
  PairRun oracle(settingsOf(Engine::BruteForce), pair.a, pair.b, settings, withThemselves);
  std::vector<std::unique_ptr<PairRun>> runs;
  for (const Settings& octree : octrees)
    runs.push_back(std::make_unique<PairRun>(octree, pair.a, pair.b, settings, withThemselves));
  std::vector<Vector3d> aBefore = pair.a.positions, bBefore = pair.b.positions, aNow = aBefore,
                        bNow = bBefore;
  Motion motion(size);
  std::size_t met = 0;
  for (int frame = 0; frame < frames; ++frame) {
    SCOPED_TRACE("frame " + std::to_string(frame));
    oracle.step(aBefore, aNow, bBefore, bNow);
    oracle.expectWellFormed(pair.a, pair.b);
    const std::vector<Rows> truth = oracle.answers();
    met += truth.front().anything();
    for (std::size_t i = 0; i < runs.size(); ++i) {
      SCOPED_TRACE(nameOf(octrees[i]));
      runs[i]->step(aBefore, aNow, bBefore, bNow);
      expectSame(runs[i]->answers(), truth);
    }
    aBefore = aNow;
    bBefore = bNow;
    motion.moveOn(aNow);
    motion.moveOn(bNow);
  }
  return met;
}

Mesh slivers(Random& random, int count) {
  Mesh mesh;
  for (int i = 0; i < count; ++i) {
    const Vector3d p = randomPoint(random, 0, 1), along = randomPoint(random, -0.3, 0.3),
                   across = randomPoint(random, -1e-9, 1e-9);
    addTriangle(mesh, p, p + along, p + 0.4 * along + across);
  }
  return mesh;
}

Mesh pleats(std::uint32_t n) {
  Mesh mesh = flat(n, 0);
  for (Vector3d& p : mesh.positions) p = {0.5 + 0.1 * std::sin(25 * p.x()), p.y(), 0.2 * p.x()};
  return mesh;
}

Mesh foldedFlat(std::uint32_t n) {
  Mesh mesh = flat(n, 0.01);
  for (Vector3d& p : mesh.positions) p.x() = std::min(p.x(), 1 - p.x());
  return mesh;
}

std::vector<Pair> pairs() {
  Random random(21);
  const Mesh thin = slivers(random, 60), fine = soup(random, 200, 0.02);
  return {{"coarse soups", soup(random, 60, 0.4), soup(random, 50, 0.3), 0.02},
          {"fine and coarse soup", fine, soup(random, 40, 0.5), 0.01},
          {"closed bodies", sphere(10, 14, {0.5, 0.5, 0.5}, 0.4),
           sphere(9, 11, {0.6, 0.55, 1.1}, 0.3), 0.03},
          {"sheets", sheet(11, 0, 0), sheet(9, 0.02, 1), 0.02},
          {"slivers", thin, soup(random, 40, 0.3), 0.02},
          {"coplanar", flat(7, 0), flat(8, 0), 0.03},
          {"folded", foldedFlat(8), pleats(10), 0.02}};
}

class Oracle : public ::testing::TestWithParam<MethodCase> {
 protected:
  /// The settings of the method, with a thickness for the scene.
  static PairSettings settingsFor(double thickness) {
    PairSettings settings = GetParam().settings;
    settings.thickness *= thickness;
    return settings;
  }
};

TEST_P(Oracle, AgreesOnSoupsBodiesSheetsSliversCoplanarAndFoldedMeshes) {
  for (const Pair& pair : pairs()) {
    SCOPED_TRACE(pair.name);
    EXPECT_GT(
        compare(pair, settingsFor(pair.thickness), octreeSettings(), 1, kShareOfCases == 1 ? 3 : 2),
        0u);
  }
}

// ---- Published meshes ----

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
    const PairSettings settings = settingsFor(0.2 * edge);
    const std::vector<Settings> octrees{settingsOf(Engine::Octree, 1),
                                        settingsOf(Engine::Octree, 2, OctreeUpdate::Rebuild)};
    EXPECT_GT(compare({"", mesh, piece, 0}, settings, octrees, edge, 2, false), 0u);
    const Mesh crumpled = shaken(patch(mesh, centre, 300), edge);
    EXPECT_GT(compare({"", crumpled, piece, 0}, settings, octrees, edge, 2), 0u);
  }
}

INSTANTIATE_TEST_SUITE_P(EveryMethod, Oracle, ::testing::ValuesIn(methodCases(1.0)),
                         [](const auto& method) { return method.param.name; });

}  // namespace
}  // namespace palpate
