#include "Fields/Description.h"
#include "Fields/Problem.h"
#include "Fields/Statistics.h"
#include "Fields/Topology.h"

#include <gtest/gtest.h>

#include <memory>
#include <optional>
#include <string>

namespace palpate {
namespace {

template <class Struct>
class FieldsTest : public testing::Test {};

using Structs =
    testing::Types<ElementPair, VertexTriangleContact, EdgeEdgeContact, ShapeContact,
                   ShapeShapeContact, ContactKey, TrackedContact, Crossing, Stencil, Validity,
                   ContinuousSettings, AutoSettings, LeafSettings, PairSettings,
                   SurfaceProxySettings, UnfinishedPair, ThreadEvent, CollisionProblem::Pair>;
TYPED_TEST_SUITE(FieldsTest, Structs);

TYPED_TEST(FieldsTest, AreInTheOrderOfTheStruct) {
  const auto object = std::make_unique<TypeParam>();
  const void* last = nullptr;
  forEachMember(*object, [&](const auto& field, const auto& member) {
    EXPECT_LT(last, static_cast<const void*>(&member)) << field.name;
    last = &member;
  });
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
