#pragma once

#include <palpate/CollisionData.h>
#include <palpate/Tracking.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <type_traits>

namespace palpate {

/// A ContactKind as a type: `if constexpr` may ask for its value.
template <ContactKind kKind>
using KindConstant = std::integral_constant<ContactKind, kKind>;

/// The list of a kind. Only this function names the five lists. all: a struct that has them as
/// members. ContactBuffers has the two lists with shapes in its member `shapes`.
template <ContactKind kKind, class Lists>
auto& contactList(Lists& all) {
  if constexpr (requires { all.shapes; } && kKind >= ContactKind::Shape)
    return contactList<kKind>(all.shapes);
  else if constexpr (kKind == ContactKind::VertexTriangle)
    return all.vertexTriangle;
  else if constexpr (kKind == ContactKind::TriangleVertex)
    return all.triangleVertex;
  else if constexpr (kKind == ContactKind::EdgeEdge)
    return all.edgeEdge;
  else if constexpr (kKind == ContactKind::Shape)
    return all.shape;
  else
    return all.shapeShape;
}

/// Calls f(kind, list) for the three lists of contacts between meshes.
template <class Lists, class F>
void forEachMeshList(Lists& all, F&& f) {
  const auto visit = [&](auto kind) { f(kind, contactList<kind()>(all)); };
  visit(KindConstant<ContactKind::VertexTriangle>());
  visit(KindConstant<ContactKind::TriangleVertex>());
  visit(KindConstant<ContactKind::EdgeEdge>());
}

/// Calls f(kind, list) for the two lists of contacts with shapes.
template <class Lists, class F>
void forEachShapeList(Lists& all, F&& f) {
  const auto visit = [&](auto kind) { f(kind, contactList<kind()>(all)); };
  visit(KindConstant<ContactKind::Shape>());
  visit(KindConstant<ContactKind::ShapeShape>());
}

/// Calls f(kind, list) for the five lists, in the order of ContactKind.
template <class Lists, class F>
void forEachContactList(Lists& all, F&& f) {
  forEachMeshList(all, f);
  forEachShapeList(all, f);
}

/// The number of contacts in the five lists.
template <class Lists>
std::size_t contactCount(const Lists& all) {
  std::size_t count = 0;
  forEachContactList(all, [&](ContactKind, const auto& list) { count += list.size(); });
  return count;
}

/// The pair's geometry, 0 or 1, of each vertex of stencil(). kind: of a contact between meshes.
constexpr std::array<std::size_t, 4> sidesOf(ContactKind kind) {
  if (kind == ContactKind::VertexTriangle) return {0, 1, 1, 1};
  if (kind == ContactKind::TriangleVertex) return {1, 0, 0, 0};
  return {0, 0, 1, 1};
}

/// The vertices of stencil().
inline std::array<std::uint32_t, 4> verticesOf(const VertexTriangleContact& c) {
  return {c.vertex, c.vertices[0], c.vertices[1], c.vertices[2]};
}
inline std::array<std::uint32_t, 4> verticesOf(const EdgeEdgeContact& c) {
  return {c.edgeA[0], c.edgeA[1], c.edgeB[0], c.edgeB[1]};
}

/// Contacts of a list are sorted by their keys, and each key is there once.
template <class Contact>
ContactKey keyOf(ContactKind kind, const Contact& contact) {
  ContactKey key{kind};
  auto& ids = key.ids;
  if constexpr (std::is_same_v<Contact, VertexTriangleContact>) {
    const bool swapped = kind == ContactKind::TriangleVertex;
    ids[swapped] = contact.vertex, ids[!swapped] = contact.triangle;
  } else if constexpr (std::is_same_v<Contact, EdgeEdgeContact>) {
    ids = {contact.edgeA[0], contact.edgeA[1], contact.edgeB[0], contact.edgeB[1]};
  } else if constexpr (std::is_same_v<Contact, ShapeContact>) {
    ids = {static_cast<std::uint32_t>(contact.element), contact.id, contact.vertices[1],
           contact.vertices[2]};
  }
  return key;
}

/// The corners of the element that a contact's key does not describe; else 0.
template <class Contact>
std::array<std::uint32_t, 3> cornersOf(const Contact& contact) {
  if constexpr (requires { contact.vertices; })
    return contact.vertices;
  else
    return {};
}

/// Makes the normal lead to the other side.
template <class Contact>
void turn(Contact& contact) {
  contact.normal = -contact.normal;
  contact.distance = -contact.distance;
}

}  // namespace palpate
