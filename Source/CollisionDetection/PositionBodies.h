#pragma once

#include "Bodies/InputChecks.h"
#include "Mesh/Motion.h"
#include "Mesh/Positions.h"
#include "Mesh/Revision.h"
#include "Core/CountedVector.h"
#include "Core/Threads.h"

#include <cstddef>
#include <memory>
#include <optional>
#include <span>

namespace palpate {

/// The arrays of positions of one geometry: those of the ends of its step, of two incoming calls,
/// of the copies of snapshots, and spare ones.
class PositionBodies {
 public:
  struct Memory {
    std::shared_ptr<CountedVector<Eigen::Vector3d>> positions;
    std::optional<Revision> revision;  ///< of its contents, if they were an end of a step
    bool isFree() const { return positions.use_count() == 1; }
  };
  struct Checked {
    Memory* memory = nullptr;
    Positions::Body positions;  ///< those in it, so that it is not free
    Eigen::AlignedBox3d bounds;
  };
  /// Checks positions while it copies them into free memory. Arguments: as of checkPositions().
  Checked checked(const GeometryLabel&, std::span<const Eigen::Vector3d>, const char* which,
                  const Threads&, const Eigen::Vector3d* from = nullptr,
                  MotionRange* moved = nullptr);
  /// Free memory with a copy of these positions, but no revision.
  /// Cost     linear in the vertices by which the contents of free memory differ.
  Memory& copyOf(const Positions&);
  /// Makes room for further vertices in the bodies of these ends, so that only they use it.
  void reserve(std::span<Positions* const> ends, std::size_t count);
  Memory* find(const Positions::Body&) noexcept;  ///< null if it is not one of these
  void releaseMemory();                           ///< frees what nothing uses

 private:
  Memory& free(const Positions* like = nullptr);

  CountedVector<std::unique_ptr<Memory>> m_bodies;
};

}  // namespace palpate
