#include "Queries/ElementsNearShape.h"
#include "Bodies/OctreeFrame.h"

#include "Common/RandomMeshes.h"
#include "Common/ShapeTruth.h"
#include "Common/TraversedPairs.h"
#include "Unit/Math/RationalOracle.h"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <vector>

// Searches of geometries' octrees: elements that just touch what is searched, near and far from the
// origin.

namespace palpate::testing {
namespace {

/// A soup with an octree: in the world, or placed at both ends of a step.
class Searched {
 public:
  Searched(Random& random, const Vector3d& at, double sizeOfAll, bool isPlaced,
           double elementSize = 0.1)
      : offset(at), size(sizeOfAll) {
    const Mesh mesh = soup(random, 60, elementSize);
    geometry.mesh.topology = MeshTopology(mesh.positions.size(), mesh.triangles);
    geometry.revisions.elements.topology = geometry.revisions.counter.next();
    const auto bodyOf = [&](double motion) {
      CountedVector<Vector3d> body;
      for (const Vector3d& p : mesh.positions)
        body.push_back(size * (p + motion * randomPoint(random, -1, 1)) +
                       (isPlaced ? Vector3d(0, 0, 0) : offset));
      return std::make_shared<const CountedVector<Vector3d>>(body);
    };
    geometry.mesh.now.setBody(bodyOf(0.0), m_revisions.next());
    geometry.mesh.before.setBodyOf(geometry.mesh.now);
    if (isPlaced) {
      geometry.mesh.now.place({randomTurn(random), offset}, m_revisions.next());
      geometry.mesh.before.place(
          {randomTurn(random), offset + size * randomPoint(random, -0.1, 0.1)}, m_revisions.next());
    } else {
      geometry.mesh.before.setBody(bodyOf(0.1), m_revisions.next());
    }
    geometry.tree.setSwept(true);
    geometry.tree.sampleFrame(geometry.mesh, geometry.revisions.elements.topology);
    geometry.tree.update(geometry.mesh, geometry.revisions.elements.topology,
                         std::ldexp(1.0, -std::ilogb(size)), {}, m_thread);
  }
  const palpate::Positions& at(bool isEnd) const {
    return isEnd ? geometry.mesh.now : geometry.mesh.before;
  }
  std::size_t elementCount() const { return geometry.mesh.topology.elements.size(); }
  const Triangle& corners(std::uint32_t element) const {
    return geometry.mesh.topology.elements[element];
  }

  Body geometry{GeometryId{0}};
  const Vector3d offset;
  const double size;

 private:
  Revision::Counter m_revisions;
  Threads m_thread{1};
};

/// Far away, coordinates are coarser than floats of the geometry's own frame. Boxes of the smallest
/// elements leave no room for errors.
Searched anySearched(Random& random, int round) {
  const double size = std::exp2(uniform(random, -3, 3));
  Vector3d offset = randomPoint(random, -1, 1);
  if (round % 3 != 0) offset *= std::exp2(uniform(random, 20, 44));
  return {random, offset, size, round % 2 == 1, random() % 2 ? 0.1 : 1e-9};
}

/// Expects all elements that are near among those that were found. Returns how many are near.
template <class IsNear>
std::size_t expectFound(const Searched& searched, Buffer<std::uint32_t>& found, IsNear isNear) {
  std::sort(found.begin(), found.end());
  std::size_t count = 0;
  for (std::uint32_t element = 0; element < searched.elementCount(); ++element) {
    if (!isNear(element)) continue;
    ++count;
    EXPECT_TRUE(std::binary_search(found.begin(), found.end(), element)) << element;
  }
  return count;
}

TEST(ElementsNearShape, HoldAllElementsWithinTheDistance) {
  Random random(21);
  Buffer<std::uint32_t> found;
  std::size_t touching = 0, left = 0;
  for (int round = 0; round < 600; ++round) {
    const Searched searched = anySearched(random, round);
    const double size = searched.size;
    const double shapeSize = size * (random() % 2 ? 1.0 : std::exp2(uniform(random, 0, 45)));
    const AnalyticalGeometry geometries[] = {
        Sphere{{0, 0, 0}, 0.05 * shapeSize},
        Capsule{{0, 0, 0}, {0.3 * shapeSize, 0, 0}, 0.05 * shapeSize},
        Box{{0, 0, 0}, shapeSize * Vector3d(0.2, 0.1, 0.05)}, Plane{{0, 0, 0}, {1, 2, 3}, false},
        Cylinder{{0, 0, 0}, {0, 0.2 * shapeSize, 0}, 0.1 * shapeSize}};
    const AnalyticalGeometry& geometry = geometries[round % 5];
    // From 2^28, rounding of distances exceeds that of boxes.
    const double away = round % 4 ? shapeSize : size * std::exp2(uniform(random, 24, 40));
    const auto pose = [&] {
      Vector3d by = away * randomPoint(random, -0.3, 1.3);
      if (round % 8 == 0) by = away * Vector3d::Unit(static_cast<int>(random() % 3));
      return Pose{randomTurn(random), searched.offset + by};
    };
    const Shape now(geometry, pose()), start(geometry, pose());
    const bool wholeStep = random() % 2;
    const Shape& before = wholeStep ? start : now;
    const auto distanceOf = [&](std::uint32_t element) {
      double least = INFINITY;
      for (const std::uint32_t v : searched.corners(element)) {
        least = std::min(least, now.signedDistance(searched.at(true)[v]).distance);
        if (wholeStep)
          least = std::min(least, before.signedDistance(searched.at(false)[v]).distance);
      }
      return least;
    };
    for (int repeat = 0; repeat < 8; ++repeat) {
      const double most =
          std::max(0.0, distanceOf(static_cast<std::uint32_t>(random() % searched.elementCount())));
      findElementsNear(searched.geometry, before, now, most, found);
      touching += expectFound(searched, found,
                              [&](std::uint32_t element) { return distanceOf(element) <= most; });
      ASSERT_FALSE(HasFailure()) << round;
      left += searched.elementCount() - found.size();
    }
  }
  EXPECT_GT(touching, 10000u);
  EXPECT_GT(left, 10000u);
}

TEST(ElementsNearShape, HoldAllElementsThatTouchABox) {
  Random random(22);
  Buffer<std::uint32_t> found;
  std::size_t touching = 0, left = 0;
  for (int round = 0; round < 1200; ++round) {
    const Searched searched = anySearched(random, round);
    const double size = searched.size;
    const bool wholeStep = random() % 2;
    // A box with a corner of an element on its border.
    const Triangle& corners =
        searched.corners(static_cast<std::uint32_t>(random() % searched.elementCount()));
    const Vector3d on = searched.at(true)[corners[random() % 3]];
    const Vector3d below = 0.1 * size * randomPoint(random, 0, 1),
                   above = 0.1 * size * randomPoint(random, 0, 1);
    Eigen::AlignedBox3d box(on - below, on + above);
    const auto axis = static_cast<int>(random() % 3);
    (random() % 2 ? box.min() : box.max())[axis] = on[axis];
    findElementsNear(searched.geometry, box, wholeStep, found);
    touching += expectFound(searched, found, [&](std::uint32_t element) {
      const Triangle& of = searched.corners(element);
      return std::any_of(of.begin(), of.end(), [&](std::uint32_t v) {
        return box.contains(searched.at(true)[v]) ||
               (wholeStep && box.contains(searched.at(false)[v]));
      });
    });
    ASSERT_FALSE(HasFailure()) << round;
    left += searched.elementCount() - found.size();
  }
  EXPECT_GT(touching, 1000u);
  EXPECT_GT(left, 10000u);
}

/// The boxes of elements in the world, which are exactly the thickness apart.
TEST(TreesOf, HaveAllPairsOfBoxesWithinTheThickness) {
  Random random(24);
  std::size_t touching = 0, left = 0;
  for (int round = 0; round < 600; ++round) {
    const Searched a = anySearched(random, round);
    const Searched b{random, a.offset + a.size * randomPoint(random, -1, 1),
                     a.size * std::exp2(uniform(random, -2, 2)), random() % 2 != 0,
                     random() % 2 ? 0.1 : 1e-9};
    if (a.geometry.tree.frame().scale != b.geometry.tree.frame().scale) continue;
    const bool wholeStep = random() % 2;
    const auto boxOf = [&](const Searched& of, std::uint32_t element) {
      Eigen::AlignedBox3d box;
      for (const std::uint32_t v : of.corners(element)) {
        box.extend(of.at(true)[v]);
        if (wholeStep) box.extend(of.at(false)[v]);
      }
      return box;
    };
    const auto gapOf = [&](std::uint32_t i, std::uint32_t j) {
      const Eigen::AlignedBox3d s = boxOf(a, i), t = boxOf(b, j);
      return std::max({0.0, (s.min() - t.max()).maxCoeff(), (t.min() - s.max()).maxCoeff()});
    };
    const auto any = [&](const Searched& of) {
      return static_cast<std::uint32_t>(random() % of.elementCount());
    };
    for (int repeat = 0; repeat < 4; ++repeat) {
      const std::uint32_t elementOfA = any(a), elementOfB = any(b);
      const double thickness = gapOf(elementOfA, elementOfB);
      const TreePair trees = treesOf(a.geometry, b.geometry, thickness, wholeStep);
      const std::vector<ElementPair> found = traversedPairs(trees);
      for (std::uint32_t i = 0; i < a.elementCount(); ++i)
        for (std::uint32_t j = 0; j < b.elementCount(); ++j) {
          if (gapOf(i, j) > thickness) continue;
          ++touching;
          ASSERT_TRUE(std::binary_search(found.begin(), found.end(), ElementPair{i, j})) << round;
        }
      left += a.elementCount() * b.elementCount() - found.size();
    }
  }
  EXPECT_GT(touching, 10000u);
  EXPECT_GT(left, 10000u);
}

/// Exact bounds of each element along each direction, in the frame of the floats.
TEST(GeometryOctree, DopsEncloseTheirElements) {
  using oracle::Rational;
  Random random(23);
  Threads thread(1);
  for (int round = 0; round < 40; ++round) {
    Searched searched{random, randomPoint(random, -5, 5), std::exp2(uniform(random, -20, 20)),
                      true};
    GeometryOctree& tree = searched.geometry.tree;
    const OctreeBounds bounds = round % 2 ? OctreeBounds::Dop14 : OctreeBounds::Dop18;
    tree.updateDops(searched.geometry.mesh, bounds, thread);
    const OctreeDops& dops = tree.octree().dops();
    ASSERT_EQ(dops.directions, directionCount(bounds));
    const auto directions = dopDirections(dops.directions);
    for (std::size_t place = 0; place < tree.ordered().size(); ++place)
      for (std::size_t k = 3; k < directions.size(); ++k) {
        std::array<Rational, 3> along;
        for (std::size_t c = 0; c < 3; ++c)
          for (int axis = 0; axis < 3; ++axis) {
            const Rational from =
                Rational(searched.geometry.mesh.now.body()[tree.ordered()[place][c]][axis]) -
                Rational(tree.frame().origin[axis]);
            along[c] += Rational(directions[k][static_cast<std::size_t>(axis)]) * from *
                        Rational(tree.frame().scale);
          }
        const auto [least, most] = std::minmax_element(along.begin(), along.end());
        ASSERT_TRUE(Rational(dops.lower[k][place]) <= *least) << round;
        ASSERT_TRUE(Rational(dops.upper[k][place]) >= *most) << round;
      }
  }
}

}  // namespace
}  // namespace palpate::testing
