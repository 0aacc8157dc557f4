#include "Fcl/Differences.h"

#include <CGAL/Exact_predicates_exact_constructions_kernel.h>
#include <CGAL/intersections.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <iterator>

// Random configurations of every pair that FCL and libccd support, in both engines. Where they
// differ, CGAL decides triangles in rational arithmetic, and a search over directions decides
// shapes.

namespace palpate::testing {
namespace {

int configurations() {
  const char* given = std::getenv("PALPATE_FCL_CONFIGURATIONS");
  return given ? std::atoi(given) : 100;
}

bool intersectExactly(const Mesh& a, std::uint32_t i, const Mesh& b, std::uint32_t j) {
  using Kernel = CGAL::Exact_predicates_exact_constructions_kernel;
  const auto corner = [](const Mesh& mesh, std::uint32_t triangle, std::size_t k) {
    const Vector3d& p = mesh.positions[mesh.triangles[triangle][k]];
    return Kernel::Point_3(p.x(), p.y(), p.z());
  };
  const Kernel::Triangle_3 first(corner(a, i, 0), corner(a, i, 1), corner(a, i, 2)),
      second(corner(b, j, 0), corner(b, j, 1), corner(b, j, 2));
  return !first.is_degenerate() && !second.is_degenerate() && CGAL::do_intersect(first, second);
}

struct TriangleTally {
  std::size_t pairs = 0, intersecting = 0, fclFalseNegatives = 0, fclFalsePositives = 0,
              palpateWrong = 0;
};

template <class Engine>
std::vector<ElementPair> intersecting(const Mesh& a, const Mesh& b) {
  Engine engine;
  const GeometryId first = engine.addTriangleMesh(a.positions, a.triangles),
                   second = engine.addTriangleMesh(b.positions, b.triangles);
  engine.addCollisionPair(first, second, {Method::Intersection});
  engine.detectCollision();
  const auto pairs = engine.collisionData(first, second).intersectingTriangles();
  return {pairs.begin(), pairs.end()};
}

/// Soups at random; on a grid, where much touches or lies in one plane; and a rotated grid, where
/// rounding decides what touches.
enum class Soups { Any, Grid, TurnedGrid };

TriangleTally compareTriangles(Soups soups, int runs) {
  Random random(11);
  TriangleTally tally;
  for (int run = 0; run < runs; ++run) {
    Mesh meshes[] = {soup(random, 40, 0.3), soup(random, 40, 0.3)};
    const Matrix3d turn = randomTurn(random);
    for (Mesh& mesh : meshes) {
      if (soups == Soups::Any) continue;
      for (Vector3d& p : mesh.positions) p = (4 * p).array().round() / 4;
      std::erase_if(mesh.triangles, [&](const Triangle& t) {
        const auto& [a, b, c] = t;
        const Vector3d &p = mesh.positions[a], &q = mesh.positions[b], &r = mesh.positions[c];
        return (q - p).cross(r - p).isZero(0);
      });
      if (soups == Soups::Grid) continue;
      for (Vector3d& p : mesh.positions) p = turn * p;
    }
    const auto& [a, b] = meshes;
    const auto ours = intersecting<OctreeBasedCD>(a, b), theirs = intersecting<FclEngine>(a, b);
    tally.pairs += a.triangles.size() * b.triangles.size();
    tally.intersecting += ours.size();
    std::vector<ElementPair> differing;
    std::set_symmetric_difference(ours.begin(), ours.end(), theirs.begin(), theirs.end(),
                                  std::back_inserter(differing));
    for (const ElementPair& pair : differing) {
      const bool truth = intersectExactly(a, pair.a, b, pair.b);
      const bool weSay = std::binary_search(ours.begin(), ours.end(), pair);
      if (weSay != truth) ++tally.palpateWrong;
      if (weSay == truth) ++(truth ? tally.fclFalseNegatives : tally.fclFalsePositives);
    }
  }
  return tally;
}

TEST(FclDifferences, Triangles) {
  std::printf(
      "| triangles | pairs | intersecting | FCL false negatives | FCL false positives | Palpate "
      "wrong |\n");
  const std::pair<const char*, Soups> all[] = {
      {"at random", Soups::Any}, {"on a grid", Soups::Grid}, {"turned grid", Soups::TurnedGrid}};
  for (const auto& [name, soups] : all) {
    const TriangleTally tally = compareTriangles(soups, configurations());
    std::printf("| %s | %zu | %zu | %zu | %zu | %zu |\n", name, tally.pairs, tally.intersecting,
                tally.fclFalseNegatives, tally.fclFalsePositives, tally.palpateWrong);
    EXPECT_EQ(tally.palpateWrong, 0u);
    EXPECT_GT(tally.intersecting, tally.pairs / 1000);
  }
}

/// The tolerance. For overlapping cylinders Docs/Shapes.md states a thousandth of the largest
/// difference.
double mostOf(const std::string& a, const std::string& b) {
  return a == "cylinder" || b == "cylinder" ? 3e-3 : kTolerance;
}

void compareShapes(const char* name, Layout layout) {
  std::printf(
      "| %s | overlap | differ | FCL wrong | worst | Palpate wrong | worst | exchanged | "
      "EPA overlap wrong | EPA wrong | worst | MPR overlap wrong | MPR wrong | worst |\n",
      name);
  const std::vector<std::string>& types = shapeTypes();
  for (std::size_t i = 0; i < 5; ++i)
    for (std::size_t j = i; j < types.size(); ++j) {
      if (types[i] == "hull" && types[j] == "two-sided plane") continue;  // FCL has none
      const Tally t = compare(types[i], types[j], layout, configurations());
      std::printf(
          "| %s, %s | %d | %d | %d | %.1g | %d | %.1g | %d | %d | %d | %.1g | %d | %d | %.1g |\n",
          types[i].c_str(), types[j].c_str(), t.overlaps, t.differ, t.fclWrong, t.worstFcl,
          t.palpateWrong, t.worstPalpate, t.exchanged, t.epaWrongOverlap, t.epaWrong, t.worstEpa,
          t.mprWrongOverlap, t.mprWrong, t.worstMpr);
      SCOPED_TRACE(types[i] + ", " + types[j]);
      EXPECT_LE(t.worstPalpate, mostOf(types[i], types[j]));
      EXPECT_LE(t.mprWrongOverlap, t.configurations / 200);
      if (layout != Layout::Small) {
        EXPECT_LE(t.epaWrongOverlap, t.configurations / 200);
      } else if (j < 5) {
        EXPECT_GT(t.epaWrongOverlap, t.overlaps * 9 / 10) << "libccd now handles small bodies";
      }
      EXPECT_GT(t.overlaps, t.configurations / 10);
    }
}

TEST(FclDifferences, RandomShapes) { compareShapes("at random", Layout::Any); }
TEST(FclDifferences, ShapesOnAGrid) { compareShapes("on a grid", Layout::Grid); }
TEST(FclDifferences, ShapesScaledByAThousandth) { compareShapes("of 1e-3", Layout::Small); }

}  // namespace
}  // namespace palpate::testing
