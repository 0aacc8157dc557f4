#pragma once

#include <palpate/StepGuard.h>

#include "CollisionDetection/StepSource.h"
#include "Mesh/Positions.h"
#include "Core/Assert.h"
#include "Core/DisjointSets.h"

#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

namespace palpate {

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

/// The parts of a guarded step: sets of nodes that make one fraction of their steps. The nodes are
/// all vertices of geometries that move, and geometries that move by their transform. A part is
/// named by one of its nodes. Its arrays remember their peak.
class GuardedParts {
 public:
  static constexpr std::uint32_t kNone = 0xffffffff;

  struct Body {
    Geometry* geometry;
    Positions given;  ///< now, at start()
    std::uint32_t firstNode;
    bool isWhole;  ///< one node for the geometry, which moves by its transform

    std::uint32_t nodeCount() const {
      return isWhole ? 1 : static_cast<std::uint32_t>(given.size());
    }
    bool moves(std::uint32_t node) const;  ///< before the step is shortened
  };

  void start(const GeometryTable&, SeparateSearches, const GuardSettings&);
  void clear() noexcept { m_bodies.clear(); }  ///< forgets the geometries

  std::span<const Body> bodies() const { return m_bodies; }  ///< by ascending id
  std::size_t nodeCount() const { return m_moves.size(); }
  std::uint32_t partOf(const Body& body, std::uint32_t node) const {
    PALPATE_ASSERT(node < body.nodeCount());
    return m_parts.find(body.firstNode + node);
  }
  /// kNone: the vertex is at rest, and in no group.
  std::uint32_t partOf(GeometryId, std::uint32_t vertex) const;
  /// Whether the part moves. kNone does not.
  bool moves(std::uint32_t part) const { return part != kNone && m_moves[part]; }
  /// Whether the part moves, and is not fixed.
  bool isFree(std::uint32_t part) const { return moves(part) && !m_isFixed[part]; }

 private:
  const Body* find(GeometryId) const;

  std::vector<Body> m_bodies;
  std::vector<Geometry*> m_geometries;
  DisjointSets m_parts;
  std::vector<std::uint8_t> m_isFixed, m_moves;  ///< by part
};

}  // namespace palpate
