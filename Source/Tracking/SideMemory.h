#pragma once

#include <palpate/Tracking.h>

#include "Contact/Contents.h"
#include "NarrowPhase/NarrowPhase.h"
#include "Core/Assert.h"
#include "Core/Buffer.h"
#include "Core/MemoryBudget.h"

#include <array>
#include <compare>
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
  /// A passage from which the features have not returned, with the features between which they are
  /// now.
  struct Side {
    Crossing passage;
    Triangle corners;  ///< of the triangle
  };

  struct VertexSide;

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
  bool changesContacts() const { return !m_courses.empty(); }  ///< apply()
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
  /// A remembered side within the step, and the features along which it slides.
  struct Course {
    Side side;    ///< at the step's end
    double time;  ///< of the passage; 0: the step began so
    bool hasPassed;
    std::size_t first, count;  ///< of m_visited
    std::uint32_t next;        ///< in the list of its features
  };

  /// An edge that may be hooked. kind: of its mesh's vertices.
  struct HookSearch {
    ContactKind kind;
    Segment edge;
    std::uint32_t course;  ///< near which it is searched
    auto operator<=>(const HookSearch&) const = default;
  };
  /// A triangle that an edge pierces.
  struct Pierced {
    double place;  ///< on the edge, in [0, 1]
    std::uint32_t triangle;
    int side;  ///< of the edge's second end
    auto operator<=>(const Pierced&) const = default;
  };

  std::size_t listOf(const Crossing&) const;
  template <class F>
  bool anyCourse(const Crossing& features, F&&) const;
  const Side* sideOf(ContactKind, std::uint32_t vertex) const;
  PartSide sideOf(const MeshPair&, ContactKind, const Part&) const;
  void turnPassed(const MeshPair&, Contents&) const;
  bool contains(const MeshPair&, const Course&, const Side&, bool* isSame = nullptr) const;
  bool hasPassedEnd(const Crossing&) const;
  void add(const MeshPair&, const Side&, double time);
  void take(const MeshPair&, const Crossing&);
  bool isOfPassedBody(const MeshPair&, const Course&) const;
  void searchHooked(const MeshPair&, std::uint32_t course);
  void addHooked(const MeshPair&, const HookSearch&);
  void addHooked(const MeshPair&, const VertexSide&, const Segment& edge, const Pierced&,
                 double direction);

  static constexpr std::uint64_t kNoStep = std::numeric_limits<std::uint64_t>::max();
  std::uint64_t m_step = kNoStep, m_version = 0;
  Buffer<Side> m_start, m_end;
  // Of follow():
  Buffer<Side> m_next;
  Buffer<Side> m_here;       ///< those of m_start that last, at the step's start
  Buffer<Course> m_courses;  ///< first those of m_here
  Buffer<Side> m_visited;
  Buffer<std::uint32_t> m_heads;  ///< of lists of m_courses: by the vertex, the last one of edges
  Buffer<std::uint32_t> m_order;
  Buffer<std::uint32_t> m_region;    ///< triangles near an edge
  Buffer<std::uint32_t> m_searched;  ///< per triangle: the last search that came to it
  std::uint32_t m_search = 0;
  Buffer<HookSearch> m_searches;
  Buffer<Pierced> m_pierced;
  ContactKind m_ofSecond = ContactKind::TriangleVertex;  ///< of the second mesh's vertices
};

}  // namespace palpate
