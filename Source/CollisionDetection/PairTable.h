#pragma once

#include <palpate/CollisionData.h>
#include <palpate/OctreeBasedCD.h>

#include "CollisionDetection/GeometryTable.h"
#include "CollisionDetection/PairMemory.h"
#include "Search/Question.h"
#include "Mesh/RestDistance.h"
#include "Core/MemoryBudget.h"

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <unordered_map>
#include <vector>

namespace palpate {

/// The state of a pair: its answer holds while this is the same.
struct PairState {
  BodyState a, b;
  Revision settings;        ///< with the predicate
  std::uint64_t sides = 0;  ///< SideMemory::version(); 0 without PairSettings::rememberSides
  friend bool operator==(const PairState&, const PairState&) = default;
};

/// The answer of the last detection of a pair that was completed.
struct LastAnswer {
  CollisionData data;
  bool isThere = false;  ///< a detection was completed
  DerivedFrom<PairState> version;
  std::array<Revision, 2> topologies;  ///< of a and b
};

/// One collision pair of the table: its two geometries and settings, its question and answer in a
/// detection, and what it remembers.
struct PairRecord : CountedObject {
  CollisionPair pair;
  Geometry* a;
  Geometry* b;
  const SupportedPairs* support = nullptr;  ///< the row of the table that answers the settings
  std::size_t index = 0;                    ///< in the table
  Revision settingsRevision;                ///< of the settings and the predicate
  PairFilters filters;
  std::optional<Question> question;  ///< of the last plan; always there
  Answer found;                      ///< of the detection that runs
  LastAnswer last;
  PairMemory memory;

  PairState state() const {
    return {a->body.state(), b->body.state(), settingsRevision,
            pair.settings.rememberSides ? memory.sides.version() : 0};
  }
  bool isCurrent() const { return last.version.isCurrent(state()); }  ///< the last answer
  bool collides() const { return a->meets(*b); }
  MeshPair meshes() const { return question->meshes(); }
  PairMoment momentIn(std::uint64_t step) {
    return {step, *question, collides(), last.data, found};
  }
  Search search() { return {&*question, &found, &memory.trust.trust, memory.kept.source(*this)}; }
  std::array<Revision, 2> topologies() const {
    return {a->body.revisions.elements.topology, b->body.revisions.elements.topology};
  }
  /// Whether the pair is answered by element pairs of two octrees. Auto's always is, for those who
  /// ask for candidates.
  bool hasCandidates() const { return support->kind == PairKind::Meshes; }

  /// Asks by another plan.
  void ask(const PairPlan&);
  /// Completes what the search found by the pair's columns: sides, smooth normals.
  void finish(const Threads&);
  /// Writes the column `tags` of what was found, if it is new.
  void addTags();
  ContactTags tagsOfShape(const ShapeContact&) const;
  /// Makes what was found the pair's answer.
  void commit(std::uint64_t step) noexcept;
  /// For rows: the contents of the last answer are those of this pair.
  void linkData() noexcept;
  /// The detection in the step with this number did not finish the pair: its result becomes that of
  /// an earlier detection, or empty if there is none for the topologies now.
  void keepLastAnswer(std::uint64_t step);
  /// PairSettings::rememberSides: replaces the sides at the start of this step. Throws
  /// NotAvailable, IndexOutOfRange.
  void setSides(std::uint64_t step, std::span<const Crossing>);
  /// Keeps the result. all: gives back also what the next detection would use again.
  void releaseMemory(bool all);
  /// What `former` has derived and holds for this pair, too. Both are of the same geometries.
  void takeOver(PairRecord& former) noexcept;
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
  void setNearAtRest(GeometryId, IndexLists&) noexcept;
  /// If so: how a cut of the topology now changes them. rest: with new vertices. Throws TooLarge.
  ChangedLists nearAtRest(GeometryId, const EdgeChange&, std::span<const Eigen::Vector3d> rest,
                          const Threads&);
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
