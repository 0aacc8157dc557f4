#pragma once

#include <palpate/StepGuard.h>

#include "CollisionDetection/StepSource.h"
#include "Mesh/Positions.h"
#include "Math/ImpactQuery.h"

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace palpate {

/// Fraction of the step: the time tolerance of a StepGuard's detections. Far below any fraction
/// that matters, so that a step is not shortened to nothing where time is left.
constexpr double kGuardTolerance = 0x1p-40;
/// The same for pairs without radii: exact arithmetic would decide smaller ones. Times below
/// kEarlyTime are computed again.
constexpr double kTouchTolerance = 0x1p-20;
constexpr double kEarlyTime = 0x1p-12;

/// What a StepGuard remembers from step to step. Ids and vertices that no longer exist do not
/// count.
struct GuardSettings {
  std::vector<std::vector<GuardedVertex>> groups;
  std::vector<GuardedVertex> fixed;                     ///< ascending
  std::vector<std::pair<GeometryId, GeometryId>> left;  ///< pairs left out, lower id first

  bool isLeftOut(GeometryId a, GeometryId b) const;
  void leaveOut(GeometryId a, GeometryId b, bool leftOut);
  void fix(GeometryId, std::span<const std::uint32_t> vertices);
};

/// Disjoint sets of numbers. A set is named by its lowest number, so that names do not depend on
/// the order in which sets were joined.
class DisjointSets {
 public:
  void start(std::size_t size);
  std::uint32_t find(std::uint32_t i) const;
  void join(std::uint32_t a, std::uint32_t b);
  std::size_t size() const { return m_parent.size(); }

 private:
  mutable std::vector<std::uint32_t> m_parent;
};

/// One step of the geometries of a StepGuard, while hold() shortens it. Its scratch remembers its
/// peak.
///
/// The nodes are all vertices of geometries that move, and geometries that move by their transform.
/// A part is a set of nodes that make one fraction of their steps; a component is a set of parts
/// that touches connect.
class GuardedStep {
 public:
  void begin(GeometryTable&, const GuardedPairs&, const GuardSettings&);
  /// Finds the touches in the pairs' results and shortens steps. Returns whether there were any.
  /// Throws ImpactRemains.
  bool shorten(const GuardedPairs&);
  /// Sets positions and transforms now.
  void apply(GeometryTable&, const Threads&);
  /// Sets them back to those at begin().
  void undo(GeometryTable&) noexcept;
  void end() noexcept;  ///< forgets the geometries
  void listHeld(std::vector<HeldVertex>& out) const;

 private:
  static constexpr std::uint32_t kNoNode = 0xffffffff;

  struct Body {
    Geometry* geometry;
    Positions given;  ///< now, at begin()
    std::uint32_t firstNode;
    bool isWhole;  ///< one node for the geometry, which moves by its transform
    std::size_t nodeCount() const { return isWhole ? 1 : given.size(); }
  };
  /// A part that takes part in a touch, and how it moves along the normal.
  struct Mover {
    std::uint32_t part;  ///< kNoNode: it does not move
    double approach;     ///< L in the step as it is now; negative: it comes nearer
  };
  struct Touch {
    std::array<Mover, 4> movers;
    double time;
    bool atStart;  ///< at the step's start, so that shortening does not help
    std::size_t pair;
    std::size_t contact;  ///< counts all contacts of the pair
  };
  /// Shortening of the parts of one component.
  struct Component {
    int alone = 0;     ///< rounds in which only approaching parts were shortened
    int together = 0;  ///< rounds since a part joined in which all were
    double factor = 1.0;
    bool shortensAll = false;
  };

  const Body* find(GeometryId) const;
  std::uint32_t nodeOf(GeometryId, std::uint32_t vertex) const;
  template <class F>
  void forEachNode(const GuardedVertex&, F&&) const;
  bool moves(const Body&, std::size_t node) const;
  bool canShorten(std::uint32_t part) const;

  template <class F>
  static void forEachContact(const PairRecord&, F&&);
  void findTouches(const GuardedPairs&);
  template <class Contact>
  void addTouch(const Contact& placed, std::size_t pair, std::size_t number);
  void addMover(Touch&, const Geometry&, std::uint32_t vertex, double approach) const;
  void joinComponents();
  void shortenApproaching(const Touch&);
  void shortenComponents();
  bool canShorten(const Touch&) const;
  [[noreturn]] void throwRemains(const GuardedPairs&, const Touch&) const;

  std::vector<Body> m_bodies;  ///< by ascending id
  std::vector<Geometry*> m_geometries;
  DisjointSets m_parts, m_connected;
  std::vector<double> m_fraction, m_factor;  ///< by part
  std::vector<std::uint8_t> m_isFixed, m_moves;
  std::vector<Component> m_components;  ///< by component
  std::vector<Touch> m_touches;
  std::vector<Eigen::Vector3d> m_positions;
};

}  // namespace palpate
