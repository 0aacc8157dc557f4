#include "Common/PairRun.h"
#include "Common/Sanitized.h"
#include "Common/DegenerateCases.h"
#include "Frame/ExactContacts.h"
#include "Frame/Placement.h"

#include <gtest/gtest.h>

#include <cstdio>
#include <memory>
#include <string>

// Transformations that round positions, for example from metres to millimetres. The contacts are
// the same, except where the exact result for the rounded positions differs.

namespace palpate {
namespace {

using namespace testing;
using Eigen::Vector3d;
using Answer = ExactContacts::Answer;

std::vector<StepScene> scenesOfSteps() {
  Random random(13);
  const Mesh first = soup(random, 30, 0.3), second = soup(random, 30, 0.3);
  const StepScene touching = latticeScene(random);
  return {stepScene("soups", first, second, 0.03),
          stepScene("sheets", sheet(8, 0, 0), sheet(7, 0.02, 1), 0.015),
          stepScene("bodies", sphere(6, 9, {0.5, 0.5, 0.5}, 0.4),
                    sphere(5, 8, {0.6, 0.55, 1.1}, 0.3), 0.03),
          touching};
}

/// Scenes are about 1 in size.
std::vector<Transformation> transformations() {
  const Vector3d direction(0.7, -1, 0.3);
  return {{.name = "metres to millimetres", .scale = 1e3},
          {.name = "millimetres to metres", .scale = 1e-3},
          {.name = "inches", .scale = 25.4, .mirror = {-1, 1, 1}},
          {.name = "moved by 1e4", .translation = 1e4 * direction},
          {.name = "moved by 1e6", .translation = 1e6 * direction},
          {.name = "moved by 1e6, in millimetres, renumbered",
           .scale = 1e3,
           .translation = 1e9 * direction,
           .corners = true,
           .triangles = true,
           .vertices = true,
           .swapped = true}};
}

class InexactTransformations : public ::testing::TestWithParam<MethodCase> {
 protected:
  /// The contacts of scenes at both places, and the counts of their comparison.
  std::size_t m_same = 0, m_different = 0;

  static bool distinct() {
    return GetParam().settings.method == Method::Proximity &&
           GetParam().settings.contacts == Contacts::Distinct;
  }
  static ExactContacts exactly(const StepScene& scene, bool self) {
    PairSettings settings = GetParam().settings;
    settings.thickness *= scene.thickness;
    return {scene, settings, self};
  }
  /// exactly() of the first call: it takes a second, and most comparisons ask for nothing.
  class Lazily {
   public:
    Lazily(const StepScene& scene, bool self) : m_scene(scene), m_self(self) {}
    const ExactContacts& operator()() const {
      if (!m_contacts) m_contacts = std::make_unique<ExactContacts>(exactly(m_scene, m_self));
      return *m_contacts;
    }

   private:
    const StepScene& m_scene;
    const bool m_self;
    mutable std::unique_ptr<ExactContacts> m_contacts;
  };
  static void expectTrue(bool found, Answer answer) {
    EXPECT_TRUE(answer == Answer::Either || found == (answer == Answer::Yes));
  }

  static std::vector<PlainContact> contacts(const Placement& placement, const PairRun& run,
                                            bool self, bool renumbered) {
    auto all = placement.contacts(run, self, GetParam().settings.contacts);
    // By definition one side only is tested: the first mesh's vertices, or the lower vertex.
    if (distinct() && renumbered)
      std::erase_if(all, [](const auto& c) { return c.ids[0] == PlainContact::VertexVertex; });
    return all;
  }

  /// A contact that one placement has and the other lacks must differ in exact arithmetic, too.
  template <class Item, class Check>
  void compare(const std::vector<Item>& own, const std::vector<Item>& other, Check&& check) {
    std::vector<Item> lost, gained;
    std::set_difference(own.begin(), own.end(), other.begin(), other.end(),
                        std::back_inserter(lost));
    std::set_difference(other.begin(), other.end(), own.begin(), own.end(),
                        std::back_inserter(gained));
    m_same += own.size() - lost.size();
    m_different += lost.size() + gained.size();
    const std::size_t step = shareOfCases(127);
    for (std::size_t i = 0; i < lost.size(); i += step) check(lost[i], true);
    for (std::size_t i = 0; i < gained.size(); i += step) check(gained[i], false);
  }

  void compare(const StepScene& scene, Transformation how) {
    how.keepsTriangles = GetParam().settings.method == Method::Intersection;
    const Placement own(scene, {}), other(scene, how);
    const PairRun run = own.run(GetParam().settings), otherRun = other.run(GetParam().settings);
    const StepScene there = placed(scene, how);
    const bool renumbered = how.swapped || how.vertices;
    for (const bool self : {false, true}) {
      const Lazily here(scene, self), thereExactly(there, self);
      compare(contacts(own, run, self, renumbered), contacts(other, otherRun, self, renumbered),
              [&](const PlainContact& c, bool wasFound) {
                SCOPED_TRACE(std::to_string(c.ids[0]) + ": " + std::to_string(c.ids[1]) + " " +
                             std::to_string(c.ids[2]) + " " + std::to_string(c.ids[3]) + " " +
                             std::to_string(c.ids[4]) + ", self: " + std::to_string(self));
                expectTrue(wasFound, here().has(c.ids));
                expectTrue(!wasFound, thereExactly().has(c.ids));
              });
    }
    const Lazily here(scene, false), thereExactly(there, false);
    compare(own.intersectingTriangles(run), other.intersectingTriangles(otherRun),
            [&](const ElementPair& pair, bool wasFound) {
              EXPECT_EQ(here().intersect(pair), wasFound);
              EXPECT_EQ(thereExactly().intersect(pair), !wasFound);
            });
    // Early by up to the tolerance, and early or late by the rounding error over the motion.
    if (GetParam().settings.method == Method::Continuous && scene.name != "lattice") {
      EXPECT_NEAR(otherRun.data().earliestTimeOfImpact(), run.data().earliestTimeOfImpact(), 2e-6);
    }
  }
};

TEST_P(InexactTransformations, ChangeContactsByRoundingOnly) {
  for (const StepScene& scene : scenesOfSteps())
    for (const Transformation& how : transformations()) {
      SCOPED_TRACE(scene.name + ", " + how.name);
      compare(scene, how);
    }
  RecordProperty("same", std::to_string(m_same));
  RecordProperty("different", std::to_string(m_different));
  std::printf("%zu contacts alike, %zu on one side only\n", m_same, m_different);
  if (GetParam().settings.continuous.earliestTimeOnly) return;
  EXPECT_GT(m_same, 1000u);
  // On the lattice everything touches. A minimum distance holds within a tolerance above rounding.
  EXPECT_EQ(m_different > 0u,
            GetParam().settings.method != Method::Continuous || GetParam().settings.thickness == 0);
}

/// Tests the exact reference above: on a sample of all features, reported or not.
TEST_P(InexactTransformations, ExactContactsMatchReportedOnes) {
  if (distinct() || GetParam().settings.continuous.earliestTimeOnly) return;
  std::size_t yes = 0, no = 0;
  for (const StepScene& scene : scenesOfSteps()) {
    if (scene.name != "lattice" && scene.name != "soups") continue;
    SCOPED_TRACE(scene.name);
    const Placement own(scene, {});
    const PairRun run = own.run(GetParam().settings);
    for (const bool self : {false, true}) {
      const ExactContacts exact = exactly(scene, self);
      const auto found = contacts(own, run, self, false);
      const auto check = [&](const PlainContact& c) {
        const bool isFound = std::binary_search(found.begin(), found.end(), c);
        expectTrue(isFound, exact.has(c.ids));
        ++(isFound ? yes : no);
      };
      const bool sampled = GetParam().name == "ContinuousWithThickness";  // many samples each
      for (std::size_t i = 0; i < found.size(); i += sampled ? 40 : 2) check(found[i]);
      const Mesh &a = scene.a, &b = self ? scene.a : scene.b;
      Random random(5);
      const auto below = [&](std::size_t n) { return static_cast<std::uint32_t>(random() % n); };
      for (int i = 0; i < 60; ++i) {
        const Triangle &s = a.triangles[below(a.triangles.size())],
                       &t = b.triangles[below(b.triangles.size())];
        const std::uint32_t corner = below(3), side = below(3);
        const Segment p{std::min(s[corner], s[(corner + 1) % 3]),
                        std::max(s[corner], s[(corner + 1) % 3])},
            q{std::min(t[side], t[(side + 1) % 3]), std::max(t[side], t[(side + 1) % 3])};
        const auto triangle = static_cast<std::uint32_t>(&t - b.triangles.data());
        const auto common = [&](std::uint32_t v, auto&& of) {
          return self && std::find(of.begin(), of.end(), v) != of.end();
        };
        PlainContact c;
        c.ids = {PlainContact::VertexTriangle, s[corner], triangle};
        if (!common(s[corner], t)) check(c);
        c.ids = {PlainContact::EdgeEdge, p[0], p[1], q[0], q[1]};
        if (!common(p[0], q) && !common(p[1], q) && !(self && q < p)) check(c);
      }
    }
  }
  EXPECT_GT(yes, 100u);
  EXPECT_GT(no, 50u);
}

INSTANTIATE_TEST_SUITE_P(EveryMethod, InexactTransformations, ::testing::ValuesIn(methodCases(1.0)),
                         [](const auto& method) { return method.param.name; });

}  // namespace
}  // namespace palpate
