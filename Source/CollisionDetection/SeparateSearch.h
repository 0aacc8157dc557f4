#pragma once

#include "CollisionDetection/PairTable.h"

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

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

/// The pairs whose sides (PairSettings::rememberSides) do not know the crossings of a step that
/// ends: something changed since the pair's last detection. Results and statistics stay as they
/// are.
class UnfollowedSides {
 public:
  /// Finds the pairs of this step. The caller detects the searches and calls follow().
  SeparateSearches find(const PairTable&, std::uint64_t step);
  /// The sides follow the crossings of the searches that were found last.
  void follow(const PairTable&);
  void releaseMemory() { m_searches.clear(); }

 private:
  SeparateSearches found() const { return std::span(m_searches).first(m_count); }

  std::vector<std::unique_ptr<SeparateSearch>> m_searches;  ///< the first m_count; scratch
  std::size_t m_count = 0;
};

}  // namespace palpate
