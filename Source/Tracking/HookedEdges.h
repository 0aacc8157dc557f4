#pragma once

#include "Tracking/PassedSide.h"
#include "Tracking/SideCourses.h"
#include "NarrowPhase/NarrowPhase.h"
#include "Core/Buffer.h"

#include <compare>
#include <cstdint>

namespace palpate {

/// Finds edges that are hooked, at the step's end, where a vertex has returned or edges have
/// passed.
///
/// An edge is hooked if its ends have not passed, are on one side of the surface, and it pierces
/// the surface. It may have passed while an end of it was behind the surface; the places at which
/// it pierces tell where.
class HookedEdges {
 public:
  void clear() { m_candidates.clear(); }
  /// Adds the edges near a course.
  void add(const MeshPair&, const SideCourses&, std::uint32_t course);
  /// Appends the sides of those that are hooked.
  void find(const MeshPair&, const SideCourses&, Buffer<PassedSide>& found);

  /// A triangle that an edge pierces.
  struct Pierced {
    double place;  ///< on the edge, in [0, 1]
    std::uint32_t triangle;
    int side;  ///< of the edge's second end
    auto operator<=>(const Pierced&) const = default;
  };

 private:
  /// An edge that may be hooked. kind: of its mesh's vertices.
  struct Candidate {
    ContactKind kind;
    Segment edge;
    std::uint32_t course;  ///< near which it is searched
    auto operator<=>(const Candidate&) const = default;
  };
  void find(const MeshPair&, const SideCourses&, const Candidate&, Buffer<PassedSide>& found);

  Buffer<Candidate> m_candidates;
  Buffer<std::uint32_t> m_region;    ///< triangles near an edge
  Buffer<std::uint32_t> m_searched;  ///< per triangle: the last search that came to it
  std::uint32_t m_search = 0;
  Buffer<Pierced> m_pierced;
};

}  // namespace palpate
