#pragma once

#include <palpate/OctreeBasedCD.h>
#include <palpate/PenetrationTracker.h>
#include <palpate/ThreadTopology.h>

#include "Core/SimdPath.h"
#include "Common/CallText.h"
#include "Common/FailingAllocation.h"
#include "Common/Model.h"

#include <gtest/gtest.h>

#include <memory>
#include <optional>
#include <ostream>
#include <string>
#include <vector>

namespace palpate::testing {

/// How an object of a Lockstep lives.
enum class Life {
  Plain,
  Restored,  ///< is led astray between calls, and restored
  /// Allocations fail, predicates throw, and detections end early or are cancelled. Each such call
  /// is made again.
  Troubled,
  Committed  ///< gets the positions of a step once, at its end, and detects once
};

/// Objects with different settings that get the same calls and must give the same answers, and a
/// model of the last values. Answers must be those of a new object with these values.
///
/// Failures are GoogleTest's. An exception of the library must be the same from each object.
class Lockstep {
 public:
  struct Member {
    std::string name;
    Life life;
    OctreeBasedCD object;
    std::string path{};  ///< of simdPaths(); empty: the best one
    std::shared_ptr<bool> predicateThrows = std::make_shared<bool>(false);
    std::optional<ThreadTopology> topology{};
    std::optional<PenetrationTracker> tracker{};
    bool endedEarly = false;  ///< a detection did, which may then check less than others
  };

  enum class Who {
    Running,  ///< those that see all positions of a step
    All
  };

  explicit Lockstep(std::uint64_t seed) : m_trouble(seed) {}
  /// path: Member::path
  void add(std::string name, Life, const Settings&, std::string path = {});
  Lockstep(const Lockstep&) = delete;
  Lockstep& operator=(const Lockstep&) = delete;

  const Model& model() const { return m_model; }
  ModelBody& body(GeometryId id) { return m_model.bodies.at(id); }
  OctreeBasedCD& first() { return m_members.front().object; }
  const OctreeBasedCD& first() const { return m_members.front().object; }
  const CollisionData& data(const ModelPair& pair) const {
    return first().collisionData(pair.a, pair.b);
  }
  /// What the troubled object's troubles depend on, from now on.
  void drawTroubles(std::uint64_t seed) { m_trouble = Random(seed); }
  /// Where calls are written; null: nowhere.
  void writeTo(std::ostream* calls) { m_calls = calls; }

  // Calls of all objects. Each changes the objects and the model, or neither. false: refused.

  std::optional<GeometryId> add(const ModelBody&);
  void remove(GeometryId);
  bool setPositions(GeometryId, const Positions& now);
  bool setPositions(GeometryId, const Positions& before, const Positions& now);
  bool setSomePositions(GeometryId, std::size_t first, const Positions& now);
  bool setTransform(GeometryId, const Pose& now);
  bool setTransform(GeometryId, const Pose& before, const Pose& now);
  bool setTriangles(GeometryId, const TestGeometry&);
  bool setTetrahedra(GeometryId, const Positions&, const std::vector<Tetrahedron>&);
  bool cut(GeometryId, const Ids& removed, const std::vector<Triangle>& added,
           const Positions& positions, const Positions& rest);
  bool cut(GeometryId, const Ids& removed, const std::vector<Tetrahedron>& added,
           const Positions& positions, const Positions& rest);
  bool setFilter(GeometryId, const CollisionFilter&);
  bool setDisabled(GeometryId, const Ids&);
  bool setTags(GeometryId, const Ids&);
  bool addPair(GeometryId a, GeometryId b, const PairSettings&);
  bool setPair(GeometryId a, GeometryId b, const PairSettings&);
  void removePair(GeometryId a, GeometryId b);
  bool setPredicate(GeometryId a, GeometryId b, int number);
  bool setSides(GeometryId a, GeometryId b, const std::vector<Crossing>&);
  bool setUserData(GeometryId a, GeometryId b, const ContactKey&, std::uint64_t);
  /// By a StepGuard of these fixed vertices. Returns how many parts it held.
  std::optional<std::size_t> hold(GeometryId fixed, const Ids& fixedVertices,
                                  const std::vector<GuardedVertex>& group);
  bool watch(const VertexPath& thread, const VertexPath& loop, bool areParts);
  void track(GeometryId vertices, GeometryId body);
  void forgetTracker();

  /// Calls f(member) of these. All accept the call, or all refuse it with the same error. text: the
  /// call as C++.
  template <class F>
  bool each(Who, const std::string& text, F&& f);

  /// A detection within the step: complete, or without any time.
  void detect() { detect(Who::Running, false); }
  bool isDetected() const { return m_isDetected; }  ///< whether the step had a detection
  /// The last detection of the step.
  void detectAtEnd(bool withoutTime);
  /// All objects have the same answers.
  void expectSame();
  void updateTopologies();
  void updateTrackers(Who);
  void advance();
  /// Leads the objects that live so through other steps and restores them.
  void restore();
  /// Writes the traces of the objects that have one.
  void writeTraces() const;
  bool watches() const { return m_members.front().topology.has_value(); }
  bool tracks() const { return m_members.front().tracker.has_value(); }
  std::size_t troubles() const { return m_troubles; }
  std::size_t endedEarly() const { return m_endedEarly; }
  /// Whether the candidates of the pair were kept ones in the last detection of an object.
  bool keepsCandidates(const ModelPair&) const;

 private:
  struct Outcome {
    std::optional<std::string> error{};
    friend bool operator==(const Outcome&, const Outcome&) = default;
  };
  template <class F>
  Outcome outcomeOf(Member&, F&&);
  /// A call as C++, with its arguments if calls are written.
  template <class... Arguments>
  std::string call(const char* name, const Arguments&... arguments) const {
    return std::string("c.") + name + "(" + (m_calls ? argumentsText(arguments...) : "") + ")";
  }
  void detect(Who, bool withoutTime);
  bool detectEverywhere(Who, bool withoutTime);
  void detect(Member&, bool withoutTime, bool atEnd);
  void commitPositions();
  /// Who gets a pose at once: all know that a geometry is placed, which pairs with itself refuse.
  Who whoIsPlaced(GeometryId id) { return body(id).placed ? Who::Running : Who::All; }
  bool isAmong(const Member& member, Who who) const {
    return who == Who::All || member.life != Life::Committed;
  }
  void readSurface(GeometryId);
  void takeTopology(GeometryId, const TestGeometry&);

  std::vector<Member> m_members;
  Model m_model;
  Random m_trouble;
  std::ostream* m_calls = nullptr;
  bool m_isDetected = false;
  std::size_t m_troubles = 0, m_endedEarly = 0;
};

template <class F>
Lockstep::Outcome Lockstep::outcomeOf(Member& member, F&& f) {
  const auto call = [&]() -> Outcome {
    try {
      f(member);
    } catch (const Error& error) {
      return {error.what()};
    }
    return {};
  };
  if (member.life != Life::Troubled || m_trouble() % 4) return call();
  std::optional<Outcome> outcome;
  const std::uint64_t most = m_trouble() % 2 ? 8 : 200;
  const std::size_t n = 1 + m_trouble() % most;
  const bool threw = FailingAllocation::throwsAt(
      n, [&] { outcome = call(); },
      m_trouble() % 2 ? FailingAllocation::Failures::One : FailingAllocation::Failures::All);
  if (!threw) return *outcome;
  ++m_troubles;
  return call();
}

template <class F>
bool Lockstep::each(Who who, const std::string& text, F&& f) {
  if (m_calls) *m_calls << "  attempt([&] { " << text << "; });\n";
  std::optional<Outcome> first;
  for (Member& member : m_members) {
    if (!isAmong(member, who)) continue;
    if (!member.path.empty()) useSimdPath(member.path);
    const Outcome outcome = outcomeOf(member, f);
    if (!member.path.empty()) useSimdPath("");
    if (!first) first = outcome;
    EXPECT_EQ(outcome.error.value_or("accepted"), first->error.value_or("accepted"))
        << text.substr(0, 200) << " of " << member.name;
  }
  return !first->error;
}

}  // namespace palpate::testing
