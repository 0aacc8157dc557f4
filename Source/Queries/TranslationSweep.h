#pragma once

#include "Queries/BodyPair.h"
#include "Queries/SweepTree.h"

#include <Eigen/Core>

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>

namespace palpate {

struct SweepScratch {
  /// Nodes, or triangles, of both bodies that meet at most from `enter` to `leave`.
  struct Task {
    double enter, leave;
    std::uint32_t a, b;
    bool areTriangles;
  };

  SweepTree a, b;
  SweepInset inset;           ///< of a
  CountedVector<Task> now;    ///< a stack
  CountedVector<Task> later;  ///< a heap by `enter`
};

/// Follows a along directions to where no triangles of both bodies cross.
///
/// Method   two triangles cross during an interval of a translation: that in which no normal of
///          either and no direction across two edges separates them. The intervals that follow each
///          other without a gap are passed; of the boxes over triangles, those that leave before
///          the end so far, or meet after it, wait or are left out. Faces that lie in each other
///          must not count, so a is made smaller by kInset where it is asked whether triangles
///          cross. They then leave each other where the true ones touch last.
/// Source   separating axes: Gottschalk, Lin, Manocha: OBBTree (1996), for triangles that move.
/// Cost     the constructor sorts the triangles, a direction is linear in the pairs of boxes and
///          triangles that meet along it.
class TranslationSweep {
 public:
  struct Contact {
    std::uint32_t elementA = kNoElement, elementB = kNoElement;
    Eigen::Vector3d normal = Eigen::Vector3d::Zero();  ///< unit: a leaves b along it
  };

  /// axis: a unit direction along which the bodies are likely to separate. It narrows the search.
  TranslationSweep(const BodyPair&, const Eigen::Vector3d& axis, SweepScratch&);

  /// from: L, where to begin. closed: faces that lie in each other count.
  void start(const Eigen::Vector3d& direction, double from, bool closed);
  struct Limits {
    double end;              ///< L
    std::size_t operations;  ///< of all directions
    bool wantsLast;          ///< last() is wanted even if it is beyond the end
  };
  /// Goes on to the end of the intervals at t(). isInside: a part of a surface is inside the other
  /// body at t(), and the next interval must be passed. Returns false if that is beyond the end,
  /// if there is no such interval, or after so many operations.
  bool advance(const Limits&, bool isInside);
  using Hit = SweepTree::Hit;  ///< t: L
  /// Where a vertex meets the other body first on its way along a direction of a, within rounding.
  /// None if it does not, or not before `end`, L.
  std::optional<Hit> firstHit(bool ofA, std::uint32_t vertex, const Eigen::Vector3d& direction,
                              double end) const;
  /// Whether the smaller a, at t(), has a part with a vertex inside b.
  bool isInsetInside() const;
  /// The triangles that touch last before about t, L, where a smaller a does not meet b. Ends what
  /// start() began.
  Contact touchingAt(const Eigen::Vector3d& direction, double t);
  double t() const { return m_t / m_unit; }                ///< L
  const Contact& last() const { return m_last; }           ///< of the last interval
  std::size_t operations() const { return m_operations; }  ///< of all directions

 private:
  using Task = SweepScratch::Task;

  Task taskOf(const SweepTree::Box& a, const SweepTree::Box& b) const;
  void enter(const Task&);
  void run();
  void runTriangles(const Task&);
  void testTriangles(const Task&);
  bool isBlocked();

  const BodyPair& m_pair;
  SweepScratch& m_scratch;
  const SweepFrame m_frame;
  const Eigen::Vector3d m_axis;  ///< in the frame
  const double m_unit;           ///< 1/L
  double m_inset = 0;
  Eigen::Vector3d m_direction = Eigen::Vector3d::Zero();  ///< in the frame
  std::array<double, 4> m_inverse{};
  bool m_isClosed = false;
  double m_limit = 0;         ///< in units; infinite if last() is wanted
  double m_t = 0, m_end = 0;  ///< in units; those of m_end and m_next are of the present round
  Contact m_last, m_next;
  bool m_findsTouch = false;
  double m_touch = 0;  ///< of touchingAt(): where m_last touches last
  /// Places of triangles that lately led beyond a limit. They may do so again.
  std::array<std::pair<std::uint32_t, std::uint32_t>, 8> m_blockers{};
  std::size_t m_blockerCount = 0;
  std::size_t m_operations = 0;
};

}  // namespace palpate
