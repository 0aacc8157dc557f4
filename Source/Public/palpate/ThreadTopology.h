#pragma once

#include <palpate/Error.h>
#include <palpate/Export.h>
#include <palpate/Types.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

namespace palpate {

class OctreeBasedCD;

/// Vertices of a geometry, in order.
struct VertexPath {
  GeometryId geometry;
  std::vector<std::uint32_t> vertices;
};

/// A change of a count of ThreadTopology.
struct ThreadEvent {
  enum class Cause {
    Passed,     ///< an edge through a side of the loop or an edge of the other part
    EndPassed,  ///< an end of the thread through the loop's surface
    Set,        ///< No update() saw a step, or both ends of a step after that of add() were set.
                ///< The change of two parts is 0: positions do not show it.
    Cut,        ///< the thread or the loop lost an edge, a vertex or its geometry
    Disabled    ///< no enabled element has one of its edges or vertices any more
  };
  std::size_t index;   ///< of add() or addParts()
  std::uint64_t step;  ///< number of advance() calls of the OctreeBasedCD before it
  Cause cause;
  int change;                           ///< of the count
  std::array<std::uint32_t, 2> thread;  ///< the edge's vertices, twice the end, or kNoElement
  std::array<std::uint32_t, 2> loop;    ///< the side's or second edge's vertices, or kNoElement
  double time;                          ///< [0, 1] within the step, as Crossing::time
  friend bool operator==(const ThreadEvent&, const ThreadEvent&) = default;
};
PALPATE_EXPORT const char* toString(ThreadEvent::Cause) noexcept;  ///< its name, or "unknown"

/// How often threads pass through loops and through each other, for example whether a stitch goes
/// through a hole, and the step in which that changed. Docs/HowTo/Sutures.md has an example.
/// Thread   consecutive vertices are joined by an edge of an enabled element. The first vertex may
///          be the last one, too: the thread is then closed.
/// Loop     a closed polygon: the rim of a hole, or a part of a thread. Its sides need no edges. An
///          edge that a side has in add() is a part of the loop, which is lost with it.
///          Its surface is the fan of triangles at its first vertex.
/// Count    how often the thread passes through the surface to the side of its winding normal, less
///          how often to the other side. Of a closed thread it is the linking number.
/// Knots    no count says whether a knot is tied. Of a loop that the same thread forms, the count
///          depends on which vertices the loop has, and on the fan: it may become 0 while the knot
///          stays tied, as when the end has gone on through the fan, and it may be 1 or -1 for a
///          thread without a knot.
/// Exact    for the positions as they are, whatever detection and filters find. Where features only
///          touch, vertices count as moved by infinitesimal lengths that depend on ids alone.
/// Parts    the count of two parts of threads is how often an edge of the first passed through an
///          edge of the second since addParts(): 1 to the side of Crossing::forward, else -1. It
///          stays 0 while the threads hold each other, whatever their ends do.
/// Cost     linear in the thread; times the loop where their boxes overlap.
class PALPATE_EXPORT ThreadTopology {
 public:
  /// The OctreeBasedCD may be moved, and destroyed before this object.
  explicit ThreadTopology(OctreeBasedCD&);
  ThreadTopology(ThreadTopology&&) noexcept;
  ThreadTopology& operator=(ThreadTopology&&) noexcept;
  ~ThreadTopology();

  /// Watches a thread and a loop, which have no common vertex. Returns their index, from 0.
  /// Errors   UnknownGeometry; UnsupportedMethod for a shape or field; IndexOutOfRange, too, for a
  ///          vertex that is named twice; InvalidSettings for vertices of a thread that no edge
  ///          joins, of a loop that no enabled element has, and for fewer than two vertices of a
  ///          thread or three of a loop.
  std::size_t add(const VertexPath& thread, const VertexPath& loop);
  /// Watches two parts of threads, which have no common vertex. Returns their index, as add().
  /// Errors   those of add().
  std::size_t addParts(const VertexPath& first, const VertexPath& second);
  /// Looks at the present step, from `before` to `now`. Call it once the positions of the step are
  /// final, before advance(); a further call in the same step replaces what the last one found.
  /// Errors   InvalidCall after a move or the end of the OctreeBasedCD.
  void update();

  int count(std::size_t index) const;    ///< after the last update(), at first of add()
  bool isLost(std::size_t index) const;  ///< there was an event by Cut or Disabled: the count is 0
  /// All events since the last clear(), by step, index and time. The changes of an index sum to
  /// those of its count since the step of add() began. Valid until the next update() or clear().
  std::span<const ThreadEvent> events() const;
  void clear();  ///< forgets events() of earlier updates

  /// All of the above as bytes, beside those of OctreeBasedCD::save(). Restore both.
  std::vector<std::byte> save() const;
  /// Throws File, with the byte, for other or changed bytes, and then changes nothing.
  void restore(std::span<const std::byte>);

 private:
  struct Implementation;
  Implementation& all() const;  ///< throws InvalidCall
  std::unique_ptr<Implementation> m_implementation;
};

}  // namespace palpate
