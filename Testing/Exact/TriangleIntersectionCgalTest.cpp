#include <palpate/FeaturePairs.h>

#include "Unit/Math/TrianglePairs.h"

#include <CGAL/Exact_predicates_exact_constructions_kernel.h>
#include <CGAL/intersections.h>

#include <gtest/gtest.h>

#include <cstdlib>
#include <variant>

namespace palpate::test {
namespace {

using Kernel = CGAL::Exact_predicates_exact_constructions_kernel;
using Shape = std::variant<Kernel::Triangle_3, Kernel::Segment_3, Kernel::Point_3>;

/// CGAL's triangles must have area. Others are passed as the segment or the point that they cover.
Shape shapeOf(const Corners& corners) {
  std::array<Kernel::Point_3, 3> p;
  for (int i = 0; i < 3; ++i) p[i] = {corners[i][0], corners[i][1], corners[i][2]};
  if (!CGAL::collinear(p[0], p[1], p[2])) return Kernel::Triangle_3(p[0], p[1], p[2]);
  const auto [first, last] = std::minmax_element(p.begin(), p.end());  // lexicographic: the ends
  if (*first == *last) return *first;
  return Kernel::Segment_3(*first, *last);
}

bool cgalIntersect(const Corners& a, const Corners& b) {
  return std::visit(
      [](const auto& s, const auto& t) {
        if constexpr (std::is_same_v<decltype(s), const Kernel::Point_3&> &&
                      std::is_same_v<decltype(t), const Kernel::Point_3&>)
          return s == t;
        else
          return CGAL::do_intersect(s, t);
      },
      shapeOf(a), shapeOf(b));
}

int pairsToTest() {
  const char* asked = std::getenv("PALPATE_EXACT_PAIRS");
  return asked ? std::atoi(asked) : 100000;
}

TEST(TriangleIntersectionCgal, EveryDecisionAgrees) {
  const int kinds = static_cast<int>(Kind::Count);
  Random random(2026);
  std::array<int, static_cast<int>(Kind::Count)> intersecting{};
  for (int i = 0; i < pairsToTest(); ++i) {
    const auto [a, b] = makePair(static_cast<Kind>(i % kinds), random);
    const bool ours = trianglesIntersect(a[0], a[1], a[2], b[0], b[1], b[2]);
    ASSERT_EQ(ours, cgalIntersect(a, b)) << "pair " << i << " of kind " << i % kinds;
    intersecting[i % kinds] += ours;
  }
  // Both results occur often in every category, so that the comparison is meaningful.
  for (int kind = 0; kind < kinds; ++kind) {
    EXPECT_GT(intersecting[kind], pairsToTest() / kinds / 100) << kind;
    const bool always = kind == static_cast<int>(Kind::SharedVertex) ||
                        kind == static_cast<int>(Kind::SharedEdge) ||
                        kind == static_cast<int>(Kind::CoplanarShared);
    EXPECT_EQ(intersecting[kind] > pairsToTest() / kinds * 98 / 100, always) << kind;
  }
}

}  // namespace
}  // namespace palpate::test
