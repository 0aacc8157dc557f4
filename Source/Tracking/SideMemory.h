#pragma once

#include <palpate/Tracking.h>

#include "Tracking/HookedEdges.h"
#include "Tracking/PassedSide.h"
#include "Tracking/SideCourses.h"
#include "Contact/Contents.h"
#include "NarrowPhase/NarrowPhase.h"
#include "Core/Assert.h"
#include "Core/Buffer.h"
#include "Core/MemoryBudget.h"

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <vector>

namespace palpate {

/// From which sides the features of one pair came (PairSettings::rememberSides).
/// Docs/HowTo/ContactsOverTime.md
/// has the rules. Its scratch remembers its peak.
class SideMemory : public CountedObject {
 public:
  using Contents = CollisionData::Contents;
  using Side = PassedSide;

  /// If a step has begun since, the sides at the end of the last one become those at its start.
  void startStep(std::uint64_t step) noexcept;
  /// Other sides at the step's start have another number.
  std::uint64_t version() const { return m_version; }
  /// The sides at the start of this step, without those of features that are no longer there.
  std::vector<Crossing> list(const MeshPair&, std::uint64_t step) const;
  /// Replaces the sides at the start of this step.
  void set(std::uint64_t step, std::span<const Side>);

  /// Finds the sides at the step's end from the passages within it.
  void follow(const MeshPair&, std::span<const Crossing> passages);
  /// Gives the pairs that had passed when the step began their contacts. Call after follow().
  void apply(const MeshPair&, Contents&) const;
  bool changesContacts() const { return !m_courses.all().empty(); }  ///< apply()
  /// What follow() found holds for the step.
  void commit() noexcept { m_end.swap(m_next); }
  /// Instead of follow(): no side is left at the step's end.
  void followNone() noexcept;
  bool isEmpty() const { return m_start.empty() && m_end.empty(); }  ///< at both ends of the step

  void releaseMemory();

  /// For saved states. self: of one geometry with itself.
  template <class File>
  void describe(File&, bool self);

 private:
  /// The vertices of one mesh that hold a closest point, with their weights.
  struct Part {
    std::array<std::uint32_t, 3> vertices{};
    std::array<double, 3> weights{};
    std::size_t size = 0;

    void add(std::uint32_t vertex, double weight) {
      PALPATE_ASSERT(size < 3);
      vertices[size] = vertex, weights[size++] = weight;
    }
    std::span<const std::uint32_t> ids() const { return std::span(vertices).first(size); }
  };
  struct PartSide {
    std::optional<bool> forward;
    bool isWhole;          ///< all vertices of the part had passed
    Eigen::Vector3d back;  ///< along the normals of the triangles through which they passed
  };
  PartSide sideOf(const MeshPair&, ContactKind, const Part&) const;
  void turnPassed(const MeshPair&, Contents&) const;

  static constexpr std::uint64_t kNoStep = std::numeric_limits<std::uint64_t>::max();
  std::uint64_t m_step = kNoStep, m_version = 0;
  Buffer<Side> m_start, m_end;
  // Of follow():
  Buffer<Side> m_next;
  SideCourses m_courses;
  HookedEdges m_hooked;
  Buffer<std::uint32_t> m_order;
};

}  // namespace palpate
