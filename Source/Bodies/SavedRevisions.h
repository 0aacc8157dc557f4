#pragma once

#include "Bodies/Body.h"
#include "Core/Archive.h"

#include <array>
#include <cstddef>
#include <cstdint>

namespace palpate {

/// The revisions of a body in a saved state.
///
/// A value that was derived from a body holds if its revisions are those of the body now, or of
/// positions to which the body may return: of an end of the step, or of the last detection. A saved
/// state names these by their place. The body that is restored may have other numbers for them. All
/// others can never return; they become a revision that is equal to no other.
struct SavedRevisions {
  BodyState now;            ///< of the body
  PositionsState detected;  ///< GeometryStep::detected()
  BodyState other{};        ///< when reading: revisions that nothing else has
  std::size_t vertexCount = 0, elementCount = 0;

  template <class File>
  void elementsOf(File& file, ElementsState& state) const {
    choose(file, state.topology, std::array{now.elements.topology}, other.elements.topology);
    choose(file, state.enabled, std::array{now.elements.enabled}, other.elements.enabled);
  }
  template <class File>
  void positionsOf(File& file, PositionsState& state) const {
    bodyOf(file, state.body);
    choose(file, state.transform,
           std::array{now.now.transform, now.before.transform, detected.transform},
           other.now.transform);
  }
  /// Of positions in the body's frame.
  template <class File>
  void bodyOf(File& file, Revision& body) const {
    choose(file, body, std::array{now.now.body, now.before.body, detected.body}, other.now.body);
  }
  template <class File>
  void stateOf(File& file, BodyState& state) const {
    elementsOf(file, state.elements);
    choose(file, state.filter, std::array{now.filter}, other.filter);
    choose(file, state.field, std::array{now.field}, other.field);
    positionsOf(file, state.before);
    positionsOf(file, state.now);
  }
  template <class File>
  void topologyOf(File& file, Revision& topology) const {
    choose(file, topology, std::array{now.elements.topology}, other.elements.topology);
  }

  template <class File, std::size_t size>
  static void choose(File& file, Revision& revision, const std::array<Revision, size>& known,
                     Revision other) {
    std::uint8_t place = 0;
    while (place < size && !(known[place] == revision)) ++place;
    file.integer(place);
    if constexpr (File::kReads) {
      file.need(place <= size, "there is no such state");
      revision = place < size ? known[place] : other;
    }
  }
};

}  // namespace palpate
