// Two steps of published simulations, with symbolic results for feature pairs that come close.
// (Belgrod et al., Time of impact dataset for continuous collision detection and a scalable
// conservative algorithm, 2021.)
#include "NarrowPhase/Continuous.h"

#include "PublishedFrames.h"
#include "Common/Sanitized.h"
#include "Unit/Math/ImpactOracle.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <limits>
#include <set>
#include <string>
#include <tuple>

namespace palpate {
namespace {

struct Step {
  const char *scene, *before, *now;
  std::size_t vertexTriangle, edgeEdge;  ///< labelled pairs
};

class ContinuousScenes : public ::testing::TestWithParam<Step> {
 protected:
  void SetUp() override {
    if (!std::filesystem::is_directory(folder))
      GTEST_SKIP() << "no ccd-scenes in PALPATE_SHARED_DATA";
    const auto frame = [&](const char* name) {
      return folder / "frames" / (std::string(name) + ".ply");
    };
    mesh = testing::readStep(frame(GetParam().before), frame(GetParam().now));
    candidates = testing::sweptCandidates(mesh);
  }
  const std::filesystem::path folder =
      std::string(PALPATE_SHARED_DATA) + "/ccd-scenes/" + GetParam().scene;
  TriangleMesh mesh;
  std::vector<ElementPair> candidates;
};

using Pairs = std::set<std::array<std::uint32_t, 2>>;

/// Vertices are numbered by their index, then edges, then triangles. Edges are ordered by (larger
/// vertex, smaller vertex).
struct PublishedIds {
  explicit PublishedIds(const MeshTopology& mesh)
      : edges(mesh.edges.begin(), mesh.edges.end()),
        triangles(static_cast<std::uint32_t>(mesh.vertexCount + edges.size())) {
    std::sort(edges.begin(), edges.end(), [](const Segment& l, const Segment& r) {
      return std::pair(l[1], l[0]) < std::pair(r[1], r[0]);
    });
    firstEdge = static_cast<std::uint32_t>(mesh.vertexCount);
  }
  std::uint32_t of(const Segment& edge) const {
    const auto found =
        std::lower_bound(edges.begin(), edges.end(), edge, [](const Segment& l, const Segment& r) {
          return std::pair(l[1], l[0]) < std::pair(r[1], r[0]);
        });
    return firstEdge + static_cast<std::uint32_t>(found - edges.begin());
  }
  std::vector<Segment> edges;
  std::uint32_t firstEdge, triangles;
};

TEST_P(ContinuousScenes, HaveNoFalseNegativesAndNoFalsePositives) {
  const auto& [scene, before, now, vertexTriangle, edgeEdge] = GetParam();
  const MeshPair pair{mesh, mesh, {Method::Continuous, 0.0, Contacts::All}};
  ContactBuffers found{};
  findContinuous(pair, candidates, found);

  const PublishedIds ids(mesh.topology);
  Pairs vertices, edges;
  for (const VertexTriangleContact& contact : found.vertexTriangle)
    vertices.insert({contact.vertex, ids.triangles + contact.triangle});
  for (const EdgeEdgeContact& contact : found.edgeEdge) {
    const std::uint32_t a = ids.of(contact.edgeA), b = ids.of(contact.edgeB);
    edges.insert({std::min(a, b), std::max(a, b)});
  }
  EXPECT_EQ(vertices.size(), vertexTriangle);
  EXPECT_EQ(edges.size(), edgeEdge);
  EXPECT_EQ(found.vertexTriangle.size(), vertexTriangle);
  EXPECT_EQ(found.edgeEdge.size(), edgeEdge);

  const auto expectLabels = [&, &before = before](const char* kind, const Pairs& contacts) {
    const std::string name = std::string(before) + kind;
    const auto pairs = testing::readPairs(folder / "boxes" / (name + ".json"));
    const auto truth = testing::readTruth(folder / "mma_bool" / (name + "_mma_bool.json"));
    ASSERT_EQ(pairs.size(), truth.size());
    ASSERT_GT(pairs.size(), 0u);
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      const auto [first, second] = std::minmax(pairs[i][0], pairs[i][1]);
      EXPECT_EQ(contacts.contains({first, second}), truth[i])
          << kind << ' ' << first << ' ' << second;
    }
  };
  expectLabels("vf", vertices);
  expectLabels("ee", edges);

  // The earliest time is that of the contacts, for one batch or many, and in reverse order.
  double earliest = std::numeric_limits<double>::infinity();
  for (const auto& contact : found.vertexTriangle)
    earliest = std::min(earliest, contact.timeOfImpact);
  for (const auto& contact : found.edgeEdge) earliest = std::min(earliest, contact.timeOfImpact);
  ContactBuffers counts{};
  const double infinity = std::numeric_limits<double>::infinity();
  EXPECT_EQ(findEarliestImpact(pair, candidates, infinity, counts), earliest);
  const auto half = std::span(candidates).first(candidates.size() / 2);
  const double second =
      findEarliestImpact(pair, std::span(candidates).subspan(half.size()), infinity, counts);
  EXPECT_EQ(findEarliestImpact(pair, half, second, counts), earliest);
}

/// PairSettings::reportCrossings: the passages of all features that touch, by rational arithmetic.
/// Of those through an edge or a vertex, all features around the place decide which of them pass.
TEST_P(ContinuousScenes, ReportExactlyThePassages) {
  const auto& [scene, before, now, vertexTriangle, edgeEdge] = GetParam();
  std::erase_if(candidates,
                [](const ElementPair& pair) { return testing::isLeftOut(pair.a + pair.b); });
  std::vector<Crossing> truth, atBorders;
  const auto addTruth = [&](bool edges, const ContactKey& key,
                            const std::array<std::uint32_t, 4>& vertices) {
    impact::Positions p;
    for (std::size_t i = 0; i < 4; ++i)
      p[i] = mesh.before[vertices[i]], p[4 + i] = mesh.now[vertices[i]];
    const impact::Query query(edges, p);
    for (const auto& passage : query.passages()) {
      truth.push_back({key.kind, key.ids, 0, passage.forward});
      if (query.isAtBorder(passage)) atBorders.push_back(truth.back());
    }
  };
  ContactBuffers found{};
  findContinuous({mesh, mesh, {.method = Method::Continuous, .contacts = Contacts::All}},
                 candidates, found);
  EXPECT_TRUE(found.passages.empty());
  for (const auto& c : found.vertexTriangle)
    addTruth(false, {ContactKind::VertexTriangle, {c.vertex, c.triangle, kNoElement, kNoElement}},
             {c.vertex, c.vertices[0], c.vertices[1], c.vertices[2]});
  for (const auto& c : found.edgeEdge)
    addTruth(true, {ContactKind::EdgeEdge, {c.edgeA[0], c.edgeA[1], c.edgeB[0], c.edgeB[1]}},
             {c.edgeA[0], c.edgeA[1], c.edgeB[0], c.edgeB[1]});
  for (const double thickness : {0.0, 1e-3}) {
    ContactBuffers with{};
    findContinuous({mesh,
                    mesh,
                    {.method = Method::Continuous,
                     .thickness = thickness,
                     .contacts = Contacts::All,
                     .reportCrossings = true}},
                   candidates, with);
    std::vector<Crossing> passages(with.passages.begin(), with.passages.end());
    const auto sort = [](std::vector<Crossing>& all) {
      for (Crossing& each : all) each.time = 0;
      std::stable_sort(all.begin(), all.end(), [](const Crossing& l, const Crossing& r) {
        return std::tie(l.kind, l.ids) < std::tie(r.kind, r.ids);
      });
    };
    sort(passages);
    sort(truth);
    const auto isIn = [](const std::vector<Crossing>& all, const Crossing& crossing) {
      return std::find(all.begin(), all.end(), crossing) != all.end();
    };
    std::vector<Crossing> expected = truth;
    std::erase_if(expected, [&](const Crossing& crossing) {
      return isIn(atBorders, crossing) && !isIn(passages, crossing);
    });
    EXPECT_EQ(passages, expected);
    EXPECT_GE(expected.size(), testing::leastOf((vertexTriangle + edgeEdge) / 10));
  }
}

INSTANTIATE_TEST_SUITE_P(Published, ContinuousScenes,
                         ::testing::Values(Step{"cloth-funnel", "227", "228", 27, 107},
                                           Step{"rod-twist", "3036", "3037", 765, 4179}),
                         [](const auto& test) {
                           std::string name = test.param.scene;
                           std::replace(name.begin(), name.end(), '-', '_');
                           return name;
                         });

}  // namespace
}  // namespace palpate
