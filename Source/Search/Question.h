#pragma once

#include <palpate/CollisionData.h>
#include <palpate/FrameStatistics.h>
#include <palpate/OctreeBasedCD.h>

#include "Search/KeptPairs.h"
#include "Validity/MethodChoice.h"
#include "Validity/Trust.h"
#include "DistanceField/FieldContacts.h"
#include "DistanceField/SurfaceProxy.h"
#include "Bodies/Body.h"
#include "Contact/Contents.h"
#include "NarrowPhase/NarrowPhase.h"
#include "Mesh/RestDistance.h"
#include "Core/Assert.h"
#include "Core/MemoryBudget.h"

#include <atomic>
#include <cstddef>
#include <memory>

namespace palpate {

/// Feature pairs that are no contacts of a pair, wherever they are.
struct PairFilters {
  ContactPredicate predicate;
  IndexLists nearAtRest;  ///< per vertex: later ones within PairSettings::restDistance at rest
};

/// What is searched in one pair of bodies in one step: contacts, by a plan. Its owner keeps what it
/// refers to.
struct Question {
  const CollisionPair& pair;
  Body &a, &b;  ///< one object for self-collision
  GeometryInStep aInStep, bInStep;
  const PairFilters& filters;
  PairPlan plan;
  /// Of b, for PairKind::Proxy and AttachedProxy.
  const SurfaceProxy* proxy = nullptr;
  bool keepsApart = false;  ///< MeshPair::keepsApart

  const PairSettings& settings() const { return pair.settings; }
  bool self() const { return &a == &b; }
  MeshPair meshes(const FloatPair* floats = nullptr) const;
  bool anyDisabled() const {
    return !a.mesh.topology.disabled.empty() || !b.mesh.topology.disabled.empty();
  }
  bool hasElements() const { return a.tree.octree().size() > 0 && b.tree.octree().size() > 0; }
  /// Whether stored boxes may enclose the whole step though the plan's method needs only its end.
  bool hasWiderBoxes() const { return !plan.swept() && (a.tree.isSwept() || b.tree.isSwept()); }
  bool hasShape() const { return a.shape || b.shape; }
  /// Of a shape and a mesh: the shape.
  const Body& shape() const {
    PALPATE_ASSERT(hasShape());
    return a.shape ? a : b;
  }
  bool usesField() const { return plan.kind == PairKind::Field; }
  /// If usesField(): the body that a distance field stands for.
  const Body& body() const {
    PALPATE_ASSERT(usesField());
    return answersByFieldOfSecond(a.mesh.topology.type, b.field.get()) ? b : a;
  }
  PlacedField placedField() const { return {*body().field, body().mesh.now}; }
  /// With a shape, or if usesField(): the body with elements.
  const Body& mesh() const { return a.shape || (usesField() && &body() == &a) ? b : a; }
};

/// What a search found, with its scratch that lasts from one search to the next.
struct Answer {
  CollisionData data;
  bool sidesAreKnown = false;  ///< KnownSides changed the contacts
  bool byBodies = false;       ///< BodyContacts changed the contacts
  bool bySides = false;        ///< SideMemory changed the contacts
  /// ContinuousSettings::earliestTimeOnly: the least time found so far.
  std::atomic<double> earliest = std::numeric_limits<double>::infinity();
  std::size_t candidateCount = 0;
  PairStatistics statistics;
  std::unique_ptr<FieldScratch> fieldScratch;  ///< null before fieldContacts()

  CollisionData::Contents& contents() { return CollisionData::Contents::of(data); }
  /// If Question::usesField(): for the contacts with the field.
  FieldContacts fieldContacts(const Question&, const PlacedField&);
};

/// Lists of candidates that last from one detection to the next.
struct KeptSource {
  KeptPairs* lists = nullptr;  ///< null: there are none
  bool answers = false;        ///< the lists have all candidates, and no octree is searched
  KeptReach reach{};
  std::size_t detections = 1;  ///< unless it answers: in how many the lists are made
};

/// One question with the place of its answer. It knows nothing of who asks.
struct Search {
  const Question* question;
  Answer* answer;
  Trust* trust = nullptr;  ///< writes Contents::validity; null: nobody asks for it
  KeptSource kept{};
};

}  // namespace palpate
