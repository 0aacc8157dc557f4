#pragma once

#include <palpate/Export.h>
#include <palpate/Types.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>

namespace palpate {

/// In which list of CollisionData a contact is.
enum class ContactKind : std::uint8_t {
  VertexTriangle,
  TriangleVertex,
  EdgeEdge,
  Shape,
  ShapeShape
};
PALPATE_EXPORT const char* toString(ContactKind) noexcept;  ///< its name, or "unknown"

/// The two features of a contact. Keys ascend in each list.
struct ContactKey {
  ContactKind kind = ContactKind::VertexTriangle;
  /// {vertex, triangle} and {triangle, vertex}, in the order of the pair; {edgeA, edgeB}; of Shape
  /// {element, id, vertices[1], vertices[2]}. Unused ids are kNoElement.
  std::array<std::uint32_t, 4> ids{kNoElement, kNoElement, kNoElement, kNoElement};
  friend bool operator==(const ContactKey&, const ContactKey&) = default;
  friend auto operator<=>(const ContactKey&, const ContactKey&) = default;
};

/// Why a contact ended. The first reason that holds counts.
enum class ContactEnd : std::uint8_t {
  None,      ///< the contact has not ended
  Cut,       ///< the topology no longer has one of its features, with the same vertices
  Disabled,  ///< no enabled element has one of its features
  Filtered,  ///< groups, the contact predicate or restDistance exclude it
  Apart      ///< its features came apart, or others hold the closest points
};
PALPATE_EXPORT const char* toString(ContactEnd) noexcept;  ///< its name, or "unknown"

/// What a contact has been since it began (PairSettings::trackContacts). A contact lasts while its
/// key is in the answer of each step; Docs/HowTo/ContactsOverTime.md says how it slides.
struct TrackedContact {
  ContactKey key;
  /// The contact at the last advance() from which it slid, whose age and data it inherits.
  std::optional<ContactKey> predecessor;
  std::uint32_t age = 0;              ///< in steps with a detection; 0: it began in this one
  std::uint64_t userData = 0;         ///< OctreeBasedCD::setUserData()
  ContactEnd end = ContactEnd::None;  ///< in CollisionData::ended()
  friend bool operator==(const TrackedContact&, const TrackedContact&) = default;
};

/// A vertex passed through a triangle, or an edge through an edge, within the step, decided
/// exactly: the signed volume of their vertices changed its sign when the features had a common
/// point. A touch is no passage, also at edges and vertices of surfaces and at the step's ends:
/// what lies on a surface is in front of it, and touching edges are displaced by an infinitesimal
/// amount, each towards its own side (Docs/Algorithms/Passages.md, with its limits).
struct Crossing {
  ContactKind kind = ContactKind::VertexTriangle;
  std::array<std::uint32_t, 4> ids{};  ///< those of ContactKey
  double time = 0.0;                   ///< [0, 1]: the exact one, or up to timeTolerance before it
  /// The vertex passed to the side of the triangle's winding normal; edge a, with the vertices p0
  /// and p1, passed to the side of edge b to which (p1 - p0) x (q1 - q0) points.
  bool forward = false;
  friend bool operator==(const Crossing&, const Crossing&) = default;
};

}  // namespace palpate

namespace std {
template <>
struct hash<palpate::ContactKey> {
  std::size_t operator()(const palpate::ContactKey& key) const noexcept {
    std::uint64_t value = 0;
    const auto add = [&](std::uint64_t word) {
      value = (value + word + 1) * 0x9e3779b97f4a7c15u;
      value ^= value >> 32;
    };
    add(static_cast<std::uint64_t>(key.kind));
    for (const std::uint32_t id : key.ids) add(id);
    return static_cast<std::size_t>(value);
  }
};
}  // namespace std
