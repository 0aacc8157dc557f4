#pragma once

#include <palpate/CollisionData.h>
#include <palpate/OctreeBasedCD.h>

#include "CollisionDetection/GeometryTable.h"
#include "CollisionDetection/Trust.h"
#include "Core/Buffer.h"
#include "NarrowPhase/NarrowPhase.h"

#include <atomic>
#include <cstdint>
#include <memory>
#include <span>
#include <unordered_map>
#include <vector>

namespace palpate {

/// One collision pair, with its answers and what they are answers to.
struct PairRecord {
  CollisionPair pair;
  Geometry* a;
  Geometry* b;
  PairPlan plan;  ///< of this frame
  Trust trust;

  /// Revisions of the geometries that an answer is of; 0: of none.
  struct AnsweredFor {
    std::uint64_t a = 0, b = 0;
    bool wholeStep = false;
    friend bool operator==(const AnsweredFor&, const AnsweredFor&) = default;
  };
  AnsweredFor revisions() const {
    const bool wholeStep = plan.method == Method::Continuous || plan.motion > 0.0;
    return {a->revisionFor(wholeStep), b->revisionFor(wholeStep), wholeStep};
  }
  MeshPair meshes(const FloatPair* floats = nullptr) const {
    PairSettings settings = pair.settings;
    settings.method = plan.method;
    return {a->mesh,
            b->mesh,
            settings,
            floats,
            plan.step,
            settings.restDistance > 0.0 ? &near : nullptr,
            predicate ? &predicate : nullptr};
  }
  bool collides() const { return a->meets(*b); }
  bool anyDisabled() const {
    return !a->mesh.topology.disabled.empty() || !b->mesh.topology.disabled.empty();
  }
  /// Finds what is too near at rest, where it has changed.
  void updateNear(double restDistance);
  /// An answer of nothing.
  void clear();

  const Geometry& mesh() const { return a->mesh.shape ? *b : *a; }  ///< of a pair with a shape

  /// Stored boxes may hold more than this pair's method asks for.
  bool widerBoxes() const { return !plan.swept() && (a->swept || b->swept); }

  CollisionData data;
  AnsweredFor dataFor;
  std::atomic<double> earliest;     ///< Contacts::Earliest: found so far in this frame
  std::size_t found = 0;            ///< candidates, when last collected or handed on
  Buffer<TrianglePair> candidates;  ///< in the order found until somebody asks for them
  AnsweredFor candidatesFor;
  bool candidatesSorted = false;
  ContactPredicate predicate;
  IndexLists near;  ///< of settings.restDistance
  std::uint64_t nearRevision = 0;
};

/// Collision pairs, found by their geometries in either order.
class PairTable {
 public:
  void add(GeometryTable&, GeometryId a, GeometryId b, const PairSettings&);
  void set(GeometryTable&, GeometryId a, GeometryId b, const PairSettings&);
  void setPredicate(const GeometryTable&, GeometryId a, GeometryId b, ContactPredicate);
  /// Throws if there is a pair of the geometry with itself.
  void checkRigid(GeometryId) const;
  void remove(GeometryTable&, GeometryId a, GeometryId b);
  void removeAllOf(GeometryId);

  PairRecord& at(const GeometryTable&, GeometryId a, GeometryId b) const;  ///< either order
  PairRecord& inOrder(const GeometryTable&, GeometryId a,
                      GeometryId b) const;  ///< throws in the other order
  std::span<const CollisionPair> pairs() const { return m_pairs; }
  std::span<const std::unique_ptr<PairRecord>> records() const { return m_records; }

 private:
  void index();

  std::vector<std::unique_ptr<PairRecord>> m_records;  ///< in the order added
  std::vector<CollisionPair> m_pairs;
  std::unordered_map<std::uint64_t, PairRecord*> m_byIds;
};

}  // namespace palpate
