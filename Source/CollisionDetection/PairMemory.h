#pragma once

#include <palpate/CollisionData.h>
#include <palpate/Settings.h>

#include "CollisionDetection/KeptCandidates.h"
#include "Search/Question.h"
#include "Validity/Trust.h"
#include "Tracking/ContactTracker.h"
#include "Tracking/SideMemory.h"
#include "DistanceField/SurfaceProxy.h"
#include "Mesh/Revision.h"
#include "Core/Threads.h"

#include <array>
#include <cstdint>
#include <memory>
#include <span>

namespace palpate {

struct PairRecord;

/// A pair in a detection, as the parts of its memory see it.
struct PairMoment {
  std::uint64_t step;        ///< the number of the step
  const Question& question;  ///< with the last plan
  bool collides;             ///< false: groups exclude the pair
  CollisionData& last;       ///< of the last detection that was completed
  Answer& found;             ///< of the detection that runs
  bool isOutdated = false;   ///< skip(): `last` is of other elements and will be cleared
};

/// One thing that a pair remembers from detection to detection. A part defines the functions that
/// concern it.
struct MemoryPart {
  void startStep(const PairMoment&) {}        ///< a detection begins, maybe in the same step
  void commit(const PairMoment&) noexcept {}  ///< what was found has become the last answer
  void skip(const PairMoment&) noexcept {}    ///< the detection had no time for the pair
  void forget() noexcept {}                   ///< the pair does not collide
  /// Gives back memory that only detections need. all: also what the next one would use again.
  void release(bool /*all*/) {}
  template <class File>
  void describe(File&, PairRecord&, const auto& /*revisions*/) {}  ///< for saved states
};

/// Whether the bodies are known to be apart.
struct TrustMemory : MemoryPart {
  Trust trust;

  void startStep(const PairMoment&) { trust = m_committed; }
  void commit(const PairMoment&) noexcept { m_committed = trust; }
  void skip(const PairMoment&) noexcept { trust = m_committed; }
  void forget() noexcept {
    trust.forget();
    m_committed = trust;
  }
  template <class File>
  void describe(File&, PairRecord&, const auto& revisions);

 private:
  Trust m_committed;  ///< a detection that throws leaves `trust` in a state between two answers
};

/// PairSettings::trackContacts.
struct TrackerMemory : MemoryPart {
  std::unique_ptr<ContactTracker> tracker;  ///< null without the setting

  /// Follows the contacts into Answer::data, or where `isCurrent`, the last answer into the step.
  void follow(const PairMoment&, bool isCurrent, ContactMatch& scratch);
  /// The last answer lasts.
  void keep(CollisionData& last) noexcept;
  void commit(const PairMoment&) noexcept;
  void skip(const PairMoment&) noexcept;
  void release(bool all);
  template <class File>
  void describe(File&, PairRecord&, const auto& revisions);
};

/// PairSettings::rememberSides. A step that ends without the setting, or whose pair groups exclude,
/// ends all sides.
struct SidesMemory : MemoryPart {
  std::unique_ptr<SideMemory> sides;  ///< null if no step had the setting, or no side is left

  std::uint64_t version() const { return sides ? sides->version() : 0; }
  /// Finds the sides at the step's end, and changes the contacts of Answer::data by those at its
  /// start.
  void follow(const Question&, Answer&);
  void startStep(const PairMoment&);
  static bool isWanted(const PairMoment&);  ///< the setting, and groups do not exclude the pair
  void commit(const PairMoment&) noexcept;
  void release(bool all);
  template <class File>
  void describe(File&, PairRecord&, const auto& revisions);
};

/// The surface proxy of b, for PairKind::Proxy. Pairs may share it.
struct ProxyMemory : MemoryPart {
  std::shared_ptr<const SurfaceProxy> proxy;

  /// Makes the proxy for the body and the settings if it is another one, or takes that of `others`.
  /// Returns whether leaves were built. Throws UnsupportedMethod.
  bool update(const PairRecord&, std::span<const std::unique_ptr<PairRecord>> others,
              const Threads&);
  void forgetBody() noexcept;
  void takeOver(ProxyMemory& former) noexcept;
  template <class File>
  void describe(File&, PairRecord&, const auto& revisions);

 private:
  struct State {
    ElementsState elements;
    Revision positions;
    friend bool operator==(const State&, const State&) = default;
  };
  bool isOf(const ProxySettings&, const State&) const;

  ProxySettings m_settings;
  DerivedFrom<State> m_version;
};

/// Detections with a budget: which pairs come first.
struct Urgency : MemoryPart {
  double distanceBound = 0.0;  ///< L: distanceBoundOf()
  bool isUnfinished = false;   ///< the detection had no time for the pair
  bool yields = false;  ///< though it began with the pair: other pairs go first the next time

  void startStep(const PairMoment&) { isUnfinished = false; }
  template <class File>
  void describe(File&, PairRecord&, const auto& revisions);
};

/// All that a pair remembers besides its last answer. A further part is one more member, which
/// forEach() names.
struct PairMemory {
  Urgency urgency;
  TrustMemory trust;
  TrackerMemory tracker;
  SidesMemory sides;
  KeptCandidates kept;
  ProxyMemory proxy;

  /// Calls f(part) for each part.
  template <class F>
  void forEach(F&& f) {
    f(urgency), f(trust), f(tracker), f(sides), f(kept), f(proxy);
  }
};

}  // namespace palpate
