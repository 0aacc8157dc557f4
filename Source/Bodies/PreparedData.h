#pragma once

#include "Bodies/TetrahedronTree.h"
#include "Bodies/WindingNumber.h"
#include "Mesh/FloatPositions.h"
#include "Mesh/Revision.h"
#include "Mesh/TetrahedralTopology.h"
#include "Core/Assert.h"
#include "Core/MemoryBudget.h"

#include <array>
#include <atomic>
#include <cstdint>
#include <mutex>
#include <optional>

namespace palpate {

/// The tetrahedra of a body that is the surface of a tetrahedral mesh.
struct Solid : CountedObject {
  TetrahedralTopology topology;
  CountedVector<std::uint32_t> tags;  ///< per tetrahedron; empty: all are 0
};

/// SpatialQueries::Source::state() and GeometryOctree::updates() at the end of a preparation.
class PreparedState {
 public:
  bool isCurrent(std::uint64_t state, std::uint64_t updates) const {
    return m_state.load(std::memory_order_acquire) == state &&
           m_updates.load(std::memory_order_relaxed) == updates;
  }
  void commit(std::uint64_t state, std::uint64_t updates) {
    PALPATE_ASSERT(state != 0);  // 0: nothing is prepared
    m_updates.store(updates, std::memory_order_relaxed);
    m_state.store(state, std::memory_order_release);
  }

 private:
  std::atomic<std::uint64_t> m_state = 0, m_updates = 0;
};

/// What queries derive from a body when one first needs it.
struct PreparedData : CountedObject {
  std::mutex mutex;                     ///< locked while a query updates what follows
  bool isClosed = false;                ///< MeshDefects::closed() for closedVersion
  DerivedFrom<Revision> closedVersion;  ///< topology
  WindingNumbers windingNumbers;
  /// The octree over the tetrahedra of a Solid.
  std::optional<TetrahedronTree> tetrahedra;
  struct TetrahedraState {
    Revision topology, positions;
    FloatFrame frame;
    friend bool operator==(const TetrahedraState&, const TetrahedraState&) = default;
  };
  DerivedFrom<TetrahedraState> tetrahedraVersion;
  /// The state for which checkInside() accepted the body and the above was updated, for each
  /// InsideRule. Read without the lock.
  std::array<PreparedState, 2> preparedFor;
};

}  // namespace palpate
