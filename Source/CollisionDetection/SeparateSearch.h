#pragma once

#include "CollisionDetection/PairTable.h"

#include <memory>
#include <optional>
#include <span>

namespace palpate {

/// A search of a pair of the table with settings of its own: that of a StepGuard, or of the sides
/// at a step's end. The pair does not see its answer.
struct SeparateSearch : CountedObject {
  /// settings: for Method::Continuous. keepsApart: MeshPair::keepsApart.
  void set(const PairRecord&, const PairSettings& settings, bool keepsApart);

  const PairRecord* of = nullptr;
  Geometry *a = nullptr, *b = nullptr;
  CollisionPair pair;
  const SupportedPairs* support = nullptr;
  bool keepsApart = false;
  std::optional<Question> question;
  Answer found;
  DerivedFrom<PairState> version;  ///< of what was found

  PairState state() const { return {a->body.state(), b->body.state(), of->settingsRevision}; }
  Search search() { return {&*question, &found}; }
};

/// In the order of the table's pairs.
using SeparateSearches = std::span<const std::unique_ptr<SeparateSearch>>;

}  // namespace palpate
