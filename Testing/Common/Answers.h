#pragma once

#include <palpate/OctreeBasedCD.h>

#include "Fields/Contacts.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <vector>

namespace palpate::testing {

/// A copy of all that a detection tells, and of the state behind it.
struct Answers {
  explicit Answers(const OctreeBasedCD& detection)
      : unfinished(detection.statistics().unfinishedPairs), state(detection.save()) {
    for (const CollisionPair& pair : detection.pairs()) {
      ids.push_back({static_cast<std::uint32_t>(pair.a), static_cast<std::uint32_t>(pair.b)});
      data.push_back(detection.collisionData(pair.a, pair.b));
    }
  }

  std::vector<std::array<std::uint32_t, 2>> ids;
  std::vector<CollisionData> data;
  std::vector<UnfinishedPair> unfinished;
  std::vector<std::byte> state;
};

/// What two objects may know of a step.
enum class Knowledge {
  Same,
  /// One has other detections or another engine behind it: it may not know whether a step began
  /// apart, and does not know whether calls were missing.
  Other
};

inline void expectSame(Validity a, Validity b, Knowledge knowledge) {
  if (knowledge == Knowledge::Other) {
    b.trusted = a.trusted;
    b.startedApart = a.startedApart;
    b.sideMayBeWrong = a.sideMayBeWrong;
    b.advanceMayBeMissing = a.advanceMayBeMissing;
    b.untrustedVerticesA = a.untrustedVerticesA;
    b.untrustedVerticesB = a.untrustedVerticesB;
  }
  forEachMember(a, [&](const auto& field, const auto& value) {
    EXPECT_TRUE(value == b.*field.member) << "Validity::" << field.name;
  });
}

inline void expectSame(const CollisionData& a, const CollisionData& b, Knowledge knowledge) {
  const auto same = [](const auto& x, const auto& y) { return std::ranges::equal(x, y); };
  EXPECT_EQ(a.hash(), b.hash());
  expectSame(a.validity(), b.validity(), knowledge);
  EXPECT_EQ(a.earliestTimeOfImpact(), b.earliestTimeOfImpact());
  EXPECT_EQ(a.errorBound(), b.errorBound());
  EXPECT_TRUE(same(a.intersectingTriangles(), b.intersectingTriangles()));
  EXPECT_TRUE(same(a.trackedVertexTriangle(), b.trackedVertexTriangle()));
  EXPECT_TRUE(same(a.trackedTriangleVertex(), b.trackedTriangleVertex()));
  EXPECT_TRUE(same(a.trackedEdgeEdge(), b.trackedEdgeEdge()));
  EXPECT_TRUE(same(a.trackedShape(), b.trackedShape()));
  EXPECT_TRUE(same(a.trackedShapeShape(), b.trackedShapeShape()));
  EXPECT_TRUE(same(a.ended(), b.ended()));
  EXPECT_TRUE(same(a.crossings(), b.crossings()));
  EXPECT_TRUE(same(a.rememberedSides(), b.rememberedSides()));
  EXPECT_TRUE(same(a.smoothVertexTriangle(), b.smoothVertexTriangle()));
  EXPECT_TRUE(same(a.smoothTriangleVertex(), b.smoothTriangleVertex()));
  EXPECT_TRUE(same(a.smoothEdgeEdge(), b.smoothEdgeEdge()));
  EXPECT_TRUE(same(a.smoothShape(), b.smoothShape()));
  for (int kind = 0; kind < 5; ++kind)
    EXPECT_TRUE(
        same(a.tags(static_cast<ContactKind>(kind)), b.tags(static_cast<ContactKind>(kind))));
}

inline void expectSame(const Answers& l, const Answers& r) {
  ASSERT_EQ(l.ids, r.ids);
  for (std::size_t i = 0; i < l.data.size(); ++i) {
    SCOPED_TRACE(::testing::Message() << "pair " << l.ids[i][0] << ", " << l.ids[i][1]);
    expectSame(l.data[i], r.data[i], Knowledge::Same);
  }
  EXPECT_EQ(l.unfinished, r.unfinished);
  EXPECT_TRUE(l.state == r.state);
}

}  // namespace palpate::testing
