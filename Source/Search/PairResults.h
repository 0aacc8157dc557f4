#pragma once

#include <palpate/CollisionData.h>
#include <palpate/FrameStatistics.h>

#include "Search/BodyContacts.h"
#include "Search/JobScratch.h"
#include "Search/Question.h"
#include "NarrowPhase/NarrowPhase.h"
#include "Contact/DistinctShapeContacts.h"
#include "Contact/FirstImpacts.h"
#include "Contact/KnownSides.h"
#include "Contact/Order.h"
#include "Contact/Piercing.h"
#include "Core/Buffer.h"

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

namespace palpate {

/// Contacts::Distinct for the contacts of a mesh and a shape.
void keepDistinct(const Question&, DistinctShapeContacts&, CountedVector<ShapeContact>&);

/// From what the jobs of a pair found to the pair's results, in steps that the kinds of work share.
/// Its scratch remembers its peak.
class PairResults {
 public:
  using Buffers = std::span<ContactBuffers* const>;

  /// Begins a pair: takes the facts of its jobs.
  void start(Jobs);
  StepFacts& facts() { return m_facts; }
  /// Contacts of all jobs, and Auto's from Intersection.
  std::vector<ContactBuffers*>& found() { return m_found; }
  std::vector<ContactBuffers*>& intersections() { return m_intersections; }

  /// Sorts the ids of the facts, each once.
  void sortFacts(const Question&);
  /// Writes found(), sorted by element ids. Returns the number of contacts from the first
  /// `preferred` buffers, which have precedence over others of the same elements.
  std::size_t order(const Search&, std::size_t preferred = 0);
  /// Writes Validity. nearby: as Trust::finish() has it. Writes no error bound.
  void assess(const Search&, bool nearby, FrameStatistics&);
  /// Contacts::Distinct for impacts before `end`.
  void keepFirstImpacts(const Search&, double end);
  /// Contacts::Distinct for a shape.
  void keepDistinct(const Search& search) {
    palpate::keepDistinct(*search.question, m_distinctContacts, search.answer->contents().shape);
  }

  /// Of work on meshes.
  struct Meshes {
    ContactBuffers pierced, leaving;  ///< of PiercingContacts, at the step's end and start
    PiercingContacts piercingContacts;
    KnownSides knownSides;
    std::unique_ptr<BodyContacts> bodies;  ///< null before a pair first needs it
  } meshes;
  ContactBuffers impacts;  ///< of touches in the step; its counts include those of assess()

 private:
  StepFacts m_facts;
  std::vector<ContactBuffers*> m_found, m_intersections;
  OrderScratch m_orderScratch;
  FirstImpacts m_firstImpacts;
  DistinctShapeContacts m_distinctContacts;
  Buffer<std::uint8_t> m_flags;
};

/// ContinuousSettings::earliestTimeOnly: replaces contacts by the earliest of their times.
void takeEarliest(const Search&, ContactBuffers&);

/// The error bound and the lists of Validity of an answer without an error.
void describeExact(CollisionData::Contents&);

/// Writes the numbers of contacts at impact and at the step's end.
void countContacts(std::size_t atImpact, CollisionData::Contents&);

}  // namespace palpate
