#include "Common/RandomMeshes.h"
#include "Common/Sanitized.h"
#include "Common/ShapeTruth.h"
#include "Unit/Queries/MovedMeshes.h"
#include "Unit/Queries/QueryTruth.h"

#include <palpate/OctreeBasedCD.h>

#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include <cmath>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

// Depths of bodies of many layers, which a short translation separates. Each pair is made so that
// this translation is known.
namespace palpate::testing {
namespace {

Penetration penetrationOf(const Mesh& a, const Mesh& b) {
  OctreeBasedCD collisions;
  const GeometryId first = collisions.addTriangleMesh(a.positions, a.triangles),
                   second = collisions.addTriangleMesh(b.positions, b.triangles);
  return collisions.queries().penetration(first, second);
}

/// The depth is at most 1.5 times a known translation that separates, and separates the bodies.
Penetration expectShort(const Mesh& a, const Mesh& b, double known, const std::string& name) {
  const Penetration p = penetrationOf(a, b);
  EXPECT_TRUE(p.intersecting) << name;
  EXPECT_LE(p.depth, 1.5 * known) << name;
  EXPECT_GT(p.depth, 0.0) << name;
  const Mesh apart = moved(a, p.depth * (1 + 1e-9) * p.direction);
  EXPECT_FALSE(penetrationOf(apart, b).intersecting) << name;
  return p;
}

/// expectShort() of bodies as they are, and turned.
void expectShortTurned(const Mesh& a, const Mesh& b, double known, const std::string& name) {
  expectShort(a, b, known, name);
  Random random(7);
  for (int i = 0; i < 2; ++i) {
    const Matrix3d turn = randomTurn(random);
    expectShort(turned(a, turn), turned(b, turn), known, name + " turned");
  }
}

/// Plates of 10 x 10 x 0.4 with a distance of 1. Their faces are divided into squares.
Mesh stack(int plates, int squares, double height) {
  Mesh mesh;
  for (int i = 0; i < plates; ++i)
    append(mesh, dividedBox({0, 0, height + i}, {10, 10, height + i + 0.4}, squares));
  return mesh;
}

TEST(LayeredPenetration, StacksOfPlatesMoveByWhatOverlaps) {
  for (const int plates : {2, 3, 7, 10, 11, 12, 20, 40})
    for (const int squares : {1, 2, 5}) {
      if (plates * squares * squares > casesOf(500)) continue;
      const std::string name = std::to_string(plates) + " of " + std::to_string(squares);
      const Mesh a = stack(plates, squares, 0), b = stack(plates, squares, 0.3);
      const Penetration p = expectShort(a, b, 0.1, name);
      EXPECT_NEAR(p.depth, 0.1, 1e-9) << name;
      EXPECT_TRUE(penetrationOf(moved(a, 0.1 * (1 - 1e-9) * p.direction), b).intersecting) << name;
    }
}

TEST(LayeredPenetration, TurnedStacksWithOtherTrianglesMoveByWhatOverlaps) {
  for (const int plates : {11, 30})
    for (const int squares : {1, 2, 4}) {
      const Mesh a = stack(plates, squares, 0);
      const std::string name = std::to_string(plates) + " of " + std::to_string(squares);
      expectShortTurned(a, stack(plates, squares + 1, 0.3), 0.1, name);
      expectShortTurned(moved(a, {2.1, 1.3, 0}), stack(plates, squares, 0.3), 0.1, name + " aside");
    }
}

/// The body between y = base and a profile over x, from z = 0 to 3. Vertical parts of a profile
/// make triangles without area.
Mesh underProfile(const std::vector<Eigen::Vector2d>& profile, double base) {
  Mesh mesh;
  for (const Eigen::Vector2d& p : profile)
    for (const double z : {0.0, 3.0}) {
      mesh.positions.push_back({p[0], base, z});
      mesh.positions.push_back({p[0], p[1], z});
    }
  const auto quad = [&](std::uint32_t p, std::uint32_t q, std::uint32_t r, std::uint32_t s) {
    mesh.triangles.push_back({p, q, r});
    mesh.triangles.push_back({p, r, s});
  };
  quad(0, 2, 3, 1);
  const auto last = static_cast<std::uint32_t>(4 * (profile.size() - 1));
  for (std::uint32_t v = 0; v < last; v += 4) {  // bit 0: on the profile, bit 1: at the end
    quad(v, v + 1, v + 5, v + 4);
    quad(v + 2, v + 6, v + 7, v + 3);
    quad(v, v + 4, v + 6, v + 2);
    quad(v + 1, v + 3, v + 7, v + 5);
  }
  quad(last, last + 1, last + 3, last + 2);
  return profile.front()[1] > base ? mesh : insideOut(mesh);
}

/// Teeth of the width 0.4 with a distance of 1, from y = root to tip.
std::vector<Eigen::Vector2d> combProfile(int teeth, double root, double tip) {
  std::vector<Eigen::Vector2d> profile;
  for (int i = 0; i < teeth; ++i) {
    profile.push_back({i, root});
    profile.push_back({i, tip});
    profile.push_back({i + 0.4, tip});
    profile.push_back({i + 0.4, root});
  }
  return profile;
}

TEST(LayeredPenetration, InterlockedCombsMoveByWhatOverlaps) {
  for (const int teeth : {2, 6, 12, 40}) {
    const std::string name = std::to_string(teeth) + " teeth";
    const Mesh lower = underProfile(combProfile(teeth, 0, 5), -1),
               upper = underProfile(combProfile(teeth, 5.5, 0.5), 7);
    expectShortTurned(lower, moved(upper, {0.3, 0, 0}), 0.1, name + " beside each other");
    expectShortTurned(moved(lower, {0, 0.55, 0}), moved(upper, {0.5, 0, 0}), 0.05, name + " tips");
  }
}

/// Pieces of a planned cut with slanted teeth, one pushed into the other.
TEST(LayeredPenetration, PiecesOfAZigzagCutLeaveAsTheyCame) {
  for (const int teeth : {4, 16, 50}) {
    std::vector<Eigen::Vector2d> profile;
    for (int i = 0; i < teeth; ++i)
      for (const auto& [x, y] : {std::pair(0.0, 0.0), {0.25, 1.5}, {0.625, 1.5}})
        profile.push_back({i + x, y});
    profile.push_back({teeth, 0});
    const Mesh lower = underProfile(profile, -2), upper = underProfile(profile, 4);
    EXPECT_FALSE(penetrationOf(lower, upper).intersecting);
    expectShort(moved(lower, {0, 0.0625, 0}), upper, 0.0625, "up");
    expectShort(moved(lower, {0.0625, 0, 0}), upper, 0.0625, "aside");
  }
}

/// Directions that are blocked up to a limit leave the next limit to others.
TEST(LayeredPenetration, PointedTeethThatLieAsideLeaveByAShortWay) {
  for (const int teeth : {4, 16}) {
    std::vector<Eigen::Vector2d> profile{{0, 0}};
    for (int i = 0; i < teeth; ++i) {
      profile.push_back({i + 0.5, 1.5});
      profile.push_back({i + 1, 0});
    }
    const Mesh lower = underProfile(profile, -2), upper = underProfile(profile, 3.5);
    expectShort(moved(lower, {0.0375, 0.05, 0}), upper, 0.0625, std::to_string(teeth) + " teeth");
  }
}

/// The layer between a body and the body scaled by less.
Mesh shell(const Mesh& unit, double outer, double inner) {
  return joined(scaledBy(unit, outer), insideOut(scaledBy(unit, inner)));
}

TEST(LayeredPenetration, NestedShellsMoveByWhatOverlaps) {
  const std::vector<std::pair<std::string, Mesh>> units{
      {"cubes", cube(-1, 1)},
      {"divided cubes", dividedBox({-1, -1, -1}, {1, 1, 1}, 4)},
      {"balls", sphere(12, 12, {0, 0, 0}, 1)}};
  for (const auto& [name, unit] : units)
    for (const int layers : {1, 2, 6}) {
      Mesh a, b;
      for (int i = 0; i < layers; ++i) {
        append(a, shell(unit, 2.0 + i, 1.8 + i));
        append(b, shell(unit, 1.7 + i, 1.5 + i));
      }
      // The distances between balls are those of their faces.
      const double gap = name == "balls" ? 0.07 : 0.1;
      expectShortTurned(moved(a, {0.15, 0, 0}), b, 0.15 - gap,
                        name + " in " + std::to_string(layers));
    }
}

TEST(LayeredPenetration, GridsOfBoxesMoveByWhatOverlaps) {
  for (const int side : {2, 4, 6}) {
    Mesh a, b;
    for (int i = 0; i < side; ++i)
      for (int j = 0; j < side; ++j)
        for (int k = 0; k < side; ++k) {
          const Vector3d at(i, j, k), size = Vector3d::Constant(0.45);
          append(a, boxMesh(at, at + size));
          append(b, boxMesh(at + Vector3d::Constant(0.5), at + Vector3d::Constant(0.5) + size));
        }
    const std::string name = "grid of " + std::to_string(side);
    expectShortTurned(moved(a, {0.1, 0.12, 0.12}), b, 0.05, name);
    expectShort(moved(a, {0.1, 0.5, 0.5}), b, 0.05, name + " in rows");
  }
}

TEST(LayeredPenetration, RowsOfAWallMoveByTheirOverlap) {
  for (const int rows : {4, 8, 14}) {
    Mesh even, odd, first, second;
    for (int r = 0; r < rows; ++r)
      for (int i = 0; i < rows; ++i) {
        const double x = 2.0 * i + r % 2;
        const Mesh brick = boxMesh({x, 0, 1.0 * r}, {x + 1.9, 1, r + 0.95});
        append(r % 2 ? odd : even, brick);
        append(i % 2 ? first : second, brick);
      }
    const std::string name = "wall of " + std::to_string(rows);
    expectShortTurned(moved(odd, {0, 0, -0.07}), even, 0.02, name);
    expectShort(moved(first, {0.12, 0, 0}), second, 0.02, name + " by columns");
  }
}

/// A prism over a regular polygon, from z = bottom to top. Its ends are fans about a corner, or
/// about their middle.
Mesh prism(std::uint32_t sides, double bottom, double top, bool hasMiddle) {
  Mesh mesh;
  for (const double z : {bottom, top})
    for (std::uint32_t i = 0; i < sides; ++i) {
      const double angle = 2 * M_PI * i / sides;
      mesh.positions.push_back({5 * std::cos(angle), 5 * std::sin(angle), z});
    }
  if (hasMiddle) {
    mesh.positions.push_back({0, 0, bottom});
    mesh.positions.push_back({0, 0, top});
  }
  for (std::uint32_t i = 0; i < sides; ++i) {
    const std::uint32_t j = (i + 1) % sides;
    mesh.triangles.push_back({i, j, sides + j});
    mesh.triangles.push_back({i, sides + j, sides + i});
    if (hasMiddle) {
      mesh.triangles.push_back({2 * sides, j, i});
      mesh.triangles.push_back({2 * sides + 1, sides + i, sides + j});
    } else if (i > 0 && j > 0) {
      mesh.triangles.push_back({0, j, i});
      mesh.triangles.push_back({sides, sides + i, sides + j});
    }
  }
  return mesh;
}

TEST(LayeredPenetration, OfPrismsWithManySidesTheDepthIsMinimal) {
  Random random(11);
  for (const std::uint32_t sides : {3u, 4u, 7u, 30u, 180u, 250u, 300u, 500u, 1000u}) {
    if (sides > static_cast<std::uint32_t>(casesOf(1000))) continue;
    for (const bool hasMiddle : {true, false})
      for (const double factor : {1.0, 1e-3, 1e6}) {
        const std::string name = std::to_string(sides) + " sides times " + std::to_string(factor);
        Mesh a = scaledBy(prism(sides, 0, 10, hasMiddle), factor),
             b = scaledBy(prism(sides, 9.9, 20, hasMiddle), factor);
        if (factor != 1.0) {
          const Matrix3d turn = randomTurn(random);
          a = turned(a, turn);
          b = turned(b, turn);
        }
        const Penetration p = expectShort(a, b, 0.1 * factor, name);
        EXPECT_NEAR(p.depth, 0.1 * factor, 1e-9 * factor) << name;
        EXPECT_TRUE(p.minimal) << name;
      }
  }
}

}  // namespace
}  // namespace palpate::testing
