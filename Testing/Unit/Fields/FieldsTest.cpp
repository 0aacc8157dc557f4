#include "Fields/FeaturePairs.h"
#include "Fields/Names.h"
#include "Fields/Problem.h"
#include "Fields/Queries.h"
#include "Fields/Rows.h"
#include "Fields/Shapes.h"
#include "Fields/Statistics.h"
#include "Fields/Topology.h"

#include <gtest/gtest.h>

#include <memory>
#include <optional>
#include <string>

namespace palpate {
namespace {

template <class... Structs>
void expectOrderOfDeclaration() {
  const auto expectOrder = [](const auto& object) {
    const void* last = nullptr;
    forEachMember(*object, [&](const auto& field, const auto& member) {
      EXPECT_LT(last, static_cast<const void*>(&member)) << field.name;
      last = &member;
    });
  };
  (expectOrder(std::make_unique<Structs>()), ...);
}

// Lists with another order of types do not compile. Members of equal types could still be swapped.
TEST(Fields, AreInTheOrderOfDeclaration) {
  expectOrderOfDeclaration<ElementPair, VertexTriangleContact, EdgeEdgeContact, ShapeContact,
                           ShapeShapeContact, ContactKey, TrackedContact, Crossing, Stencil,
                           Validity, VertexTriangleDistance, EdgeEdgeDistance,
                           CollisionProblem::Pair, ThreadEvent, HeldVertex>();
  expectOrderOfDeclaration<SurfacePoint, SignedDistance, Ray, RayHit, Pick, GeometryDistance,
                           Penetration, PathInterval, PathClearance, InsideSettings, InsideVertex,
                           TrackedVertex, TetrahedronPoint, EmbeddedVertex, ConstraintRow,
                           ContactMotion>();
  expectOrderOfDeclaration<OctreeSettings, AuditSettings, Settings, ContinuousSettings,
                           AutoSettings, LeafSettings, PairSettings, SurfaceProxySettings,
                           CollisionFilter, ContactFeatures, MemoryUse, UnfinishedPair,
                           FrameStatistics::Stages, FrameStatistics, PairStatistics,
                           OctreeStatistics, Sphere, Capsule, Plane, Box, Cylinder, ConvexHull>();
}

struct Sample {
  int a;
  bool b;
  std::optional<ContactKey> c;
  Eigen::Vector3d d;
};
static_assert(kBeginsWith<Sample, int, bool, std::optional<ContactKey>, Eigen::Vector3d>);
static_assert(!kHasMoreThan<Sample, int, bool, std::optional<ContactKey>, Eigen::Vector3d>);
static_assert(kHasMoreThan<Sample, int, bool, std::optional<ContactKey>>);
static_assert(kHasMoreThan<Sample, int, bool>);
static_assert(!kBeginsWith<Sample, bool, int>);

TEST(Fields, HaveNamesInTheStyleOfCAndPython) {
  EXPECT_STREQ(snakeCase("timeOfImpact").text, "time_of_impact");
  EXPECT_STREQ(snakeCase("p0").text, "p0");
  EXPECT_EQ(nameOfType<ContactFeatures::Kind>(), "ContactFeatures::Kind");
}

TEST(Enumerators, HaveTheirNames) {
  static_assert(kEnumerators<Method>.size() == 6 && kEnumerators<GeometryId>.empty());
  EXPECT_EQ(kEnumerators<Method>[0], "Auto");
  EXPECT_EQ(kEnumerators<Method>[5], "Proxy");
  EXPECT_EQ(kEnumerators<ContactFeatures::Kind>[1], "TriangleVertex");
  EXPECT_STREQ(toString(ContactEnd::Apart), "Apart");
  EXPECT_STREQ(toString(static_cast<Method>(6)), "unknown");
  EXPECT_STREQ(toString(static_cast<Method>(-1)), "unknown");
}

}  // namespace
}  // namespace palpate
