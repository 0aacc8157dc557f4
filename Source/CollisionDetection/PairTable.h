#pragma once

#include <palpate/CollisionData.h>
#include <palpate/OctreeBasedCD.h>

#include "CollisionDetection/GeometryTable.h"
#include "CollisionDetection/KeptPairs.h"
#include "Validity/Trust.h"
#include "DistanceField/FieldContacts.h"
#include "DistanceField/SurfaceProxy.h"
#include "Tracking/ContactTracker.h"
#include "Tracking/SideMemory.h"
#include "NarrowPhase/NarrowPhase.h"
#include "Mesh/RestDistance.h"
#include "Core/Assert.h"
#include "Core/Buffer.h"
#include "Core/MemoryBudget.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <unordered_map>
#include <vector>

namespace palpate {

/// One collision pair, with its results and the states for which they hold.
struct PairRecord : CountedObject {
  CollisionPair pair;
  Geometry* a;
  Geometry* b;
  const SupportedPairs* support = nullptr;  ///< the row of the table that answers the settings
  PairPlan plan;  ///< of this frame; only Auto's may be of another kind than `support`
  KeptPairs kept;
  bool keeps = false;                  ///< this frame's candidates are those of `kept`
  bool gathers = false;                ///< they are searched, and some go to `kept`
  bool followsCut = false;             ///< elements are others than those of the last detection
  bool countIsPending = false;         ///< the candidates of `kept` were not counted yet
  int slowFrames = 0;                  ///< consecutive detections in which candidates could be kept
  double recentSpeed = 0;              ///< L: PairPlan::motion, recently the largest that was slow
  std::size_t searchedCandidates = 0;  ///< of the last search
  std::size_t workedPairs = 0;         ///< with feature pairs, of the last detection of the pair
  int pauseFrames = 0;                 ///< detections for which candidates are not kept
  int nextPause = 0;                   ///< how many that are the next time
  std::array<ElementsState, 2> keptElements;  ///< those of a and b in `kept`
  Trust trust;

  struct State {
    BodyState a, b;
    Revision settings;        ///< with the predicate
    std::uint64_t sides = 0;  ///< SideMemory::version()
    friend bool operator==(const State&, const State&) = default;
  };
  using Derived = DerivedFrom<State>;
  State state() const {
    return {a->body.state(), b->body.state(), settingsRevision, sides ? sides->version() : 0};
  }
  std::array<Revision, 2> topologies() const {
    return {a->body.revisions.elements.topology, b->body.revisions.elements.topology};
  }
  MeshPair meshes(const FloatPair* floats = nullptr) const {
    PairSettings settings = pair.settings;
    settings.method = plan.method;
    if (settings.continuous.earliestTimeOnly) settings.contacts = Contacts::All;
    const PairRecord& filters = guarded ? *guarded : *this;
    return {a->body.mesh,
            b->body.mesh,
            settings,
            floats,
            plan.step,
            settings.restDistance > 0.0 ? &filters.nearAtRest : nullptr,
            filters.predicate ? &filters.predicate : nullptr,
            guarded && !settings.reportCrossings};
  }
  /// Whether a distance field answers in this frame.
  bool usesField() const { return plan.kind == PairKind::Field; }
  const Geometry& body() const {  ///< if usesField()
    PALPATE_ASSERT(usesField());
    return answersByFieldOfSecond(a->body.mesh.topology.type, b->body.field.get()) ? *b : *a;
  }
  PlacedField placedField() const {
    PALPATE_ASSERT(usesField());
    return {*body().body.field, body().body.mesh.now};
  }  ///< if usesField()
  /// If usesField(): for the contacts with the field. Allocates fieldScratch when first called.
  FieldContacts fieldContacts(const PlacedField&);
  bool collides() const { return a->meets(*b); }
  bool anyDisabled() const {
    return !a->body.mesh.topology.disabled.empty() || !b->body.mesh.topology.disabled.empty();
  }
  /// Follows the contacts into `next`, or where it holds, the result into the step with this number
  /// (PairSettings::trackContacts). Empties `next` of a pair that does not collide.
  void track(std::uint64_t step, ContactMatch& scratch);
  /// Writes Contents::tags of `next`, if it is new.
  void addTags();
  /// PairSettings::rememberSides: begins the step with this number if it has not begun.
  void startSides(std::uint64_t step);
  /// Replaces the sides at the start of this step. Throws NotAvailable, IndexOutOfRange.
  void setSides(std::uint64_t step, std::span<const Crossing>);
  /// Finds the sides at the step's end, and changes the contacts of `next` by those at its start.
  void followSides();
  /// Makes `next` the pair's result.
  void commit() noexcept;
  /// For rows: the contents of `data` are those of this pair.
  void linkData() noexcept;
  /// The detection in the step with this number did not finish the pair: its result becomes that of
  /// an earlier detection, or empty if there is none for the topologies now.
  void keepLastAnswer(std::uint64_t step);
  /// Commits an empty result, for a pair that does not collide.
  void commitEmpty() noexcept;

  void releaseMemory();  ///< keeps the result
  void releaseBurst();   ///< the same, but for lists that detections use

  /// What `former` has derived and holds for this pair, too. Both are of the same geometries.
  void takeOver(PairRecord& former) noexcept;

  /// Whether the pair is answered by element pairs of two octrees. Auto's always is, for those who
  /// ask for candidates.
  bool hasCandidates() const { return support->kind == PairKind::Meshes; }
  /// Makes `proxy` for the body and the settings if it is another one, or takes that of `others`.
  /// Returns whether leaves were built.
  bool updateProxy(std::span<const std::unique_ptr<PairRecord>> others, const Threads&);
  /// For a pair with a shape, or if usesField(): the geometry with elements.
  const Geometry& mesh() const { return a->body.shape || (usesField() && &body() == a) ? *b : *a; }
  /// Of a shape and a mesh: the shape.
  const Geometry& shape() const {
    PALPATE_ASSERT(a->body.shape || b->body.shape);
    return a->body.shape ? *a : *b;
  }

  /// Whether stored boxes may enclose the whole step though this pair's method needs only its end.
  bool hasWiderBoxes() const {
    return !plan.swept() && (a->body.tree.isSwept() || b->body.tree.isSwept());
  }

  void releaseResults();  ///< what the result does not need

  /// The pair whose filters apply: that which a StepGuard guards, or whose crossings are found.
  /// Null: a pair of the table.
  const PairRecord* guarded = nullptr;
  std::size_t index = 0;  ///< in the table
  Revision settingsRevision;
  CollisionData data;  ///< of the last detection that was completed
  Derived dataVersion;
  bool hasData = false;                    ///< a detection was completed
  std::array<Revision, 2> dataTopologies;  ///< of a and b in `data`
  // Of a detection with a budget:
  double distanceBound = 0.0;  ///< L: distanceBoundOf()
  bool isUnfinished = false;   ///< it had no time for the pair
  bool yields = false;  ///< though it began with the pair: other pairs go first the next time
  CollisionData next;   ///< of the detection that runs
  bool sidesAreKnown = false;  ///< whether KnownSides changed the last answer
  bool byBodies = false;       ///< whether BodyContacts changed the last answer
  std::atomic<double>
      earliest;  ///< ContinuousSettings::earliestTimeOnly: found so far in this frame
  std::size_t candidateCount = 0;           ///< number of candidates when last found
  PairStatistics statistics;                ///< of the last detection
  std::unique_ptr<ContactTracker> tracker;  ///< with PairSettings::trackContacts
  std::unique_ptr<SideMemory> sides;        ///< with PairSettings::rememberSides
  std::unique_ptr<PairRecord> atEnd;        ///< its detection by advance()
  std::unique_ptr<FieldScratch> fieldScratch;
  ContactPredicate predicate;
  IndexLists nearAtRest;  ///< per vertex: later ones within settings.restDistance at rest
  std::shared_ptr<const SurfaceProxy> proxy;  ///< of b, for PairKind::Proxy; pairs may share it
  ProxySettings proxySettings;
  struct ProxyState {  ///< of b
    ElementsState elements;
    Revision positions;
    friend bool operator==(const ProxyState&, const ProxyState&) = default;
  };
  DerivedFrom<ProxyState> proxyVersion;
};

/// Collision pairs, found by their geometries in either order.
class PairTable {
 public:
  void add(GeometryTable&, GeometryId a, GeometryId b, const PairSettings&, const Threads&);
  /// A pair of a saved state. isPlaced: of a. former: a pair of the same two geometries, from which
  /// the new one will takeOver(), or null.
  PairRecord& add(Geometry& a, Geometry& b, const PairSettings&, bool isPlaced,
                  const PairRecord* former, const Threads&);
  PairRecord* find(GeometryId a, GeometryId b) const;  ///< in this order; null if there is none
  /// A table without pairs, whose revisions differ from all of this one.
  PairTable successor() const;
  void set(GeometryTable&, GeometryId a, GeometryId b, const PairSettings&, const Threads&);
  /// Whether a pair of the geometry with itself has a restDistance.
  bool needsNearAtRest(GeometryId) const;
  /// If so: the vertices that are near at rest, in a new topology. Throws TooLarge.
  IndexLists nearAtRest(GeometryId, const MeshTopology&, std::span<const Eigen::Vector3d> rest,
                        const Threads&) const;
  void setNearAtRest(GeometryId, IndexLists) noexcept;
  /// If so: how a cut of the topology now changes them. rest: with new vertices. Throws TooLarge.
  ChangedLists changeNearAtRest(GeometryId, const EdgeChange&,
                                std::span<const Eigen::Vector3d> rest, const Threads&);
  void setNearAtRest(GeometryId, ChangedLists&) noexcept;
  void setPredicate(const GeometryTable&, GeometryId a, GeometryId b, ContactPredicate);
  /// Throws if there is a pair of the geometry with itself.
  void checkRigid(const Geometry&) const;
  /// Throws if a pair by Method::DistanceField cannot do with this field of the geometry, or
  /// without one.
  void checkFieldChange(GeometryId, const DistanceField*) const;
  void remove(GeometryTable&, GeometryId a, GeometryId b);
  void removeAllOf(GeometryId) noexcept;

  PairRecord& at(const GeometryTable&, GeometryId a, GeometryId b) const;  ///< either order
  PairRecord& inOrder(const GeometryTable&, GeometryId a,
                      GeometryId b) const;  ///< throws in the other order
  std::span<const CollisionPair> pairs() const { return m_pairs; }
  std::span<const std::unique_ptr<PairRecord>> records() const { return m_records; }

 private:
  template <class Predicate>
  void removeIf(Predicate&&) noexcept;

  CountedVector<std::unique_ptr<PairRecord>> m_records;  ///< in the order added
  CountedVector<CollisionPair> m_pairs;                  ///< copies of those in m_records
  Revision::Counter m_revisions;
  std::unordered_map<std::uint64_t, PairRecord*, std::hash<std::uint64_t>, std::equal_to<>,
                     CountedAllocator<std::pair<const std::uint64_t, PairRecord*>>>
      m_byIds;
};

std::string nameOf(const GeometryLabel& a, const GeometryLabel& b);  ///< "pair (3, 4)"

}  // namespace palpate
