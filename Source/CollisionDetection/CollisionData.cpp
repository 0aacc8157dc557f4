#include <palpate/CollisionData.h>

#include "CollisionDetection/StepRows.h"
#include "Contact/ContactLists.h"

#include <algorithm>
#include <bit>
#include <functional>
#include <type_traits>

namespace palpate {

namespace {

/// FNV-1a over 64-bit words.
class Hash {
 public:
  void add(const auto&... values) { (addOne(values), ...); }
  std::uint64_t value() const { return m_value; }

 private:
  template <class T>
  void addOne(const T& value) {
    if constexpr (std::is_floating_point_v<T>) {
      addOne(std::bit_cast<std::uint64_t>(value));
    } else if constexpr (std::is_integral_v<T>) {
      for (int i = 0; i < 64; i += 8)
        m_value = (m_value ^ (std::uint64_t{value} >> i & 0xff)) * 0x100000001b3u;
    } else {
      for (const auto& part : value) addOne(part);
    }
  }

  std::uint64_t m_value = 0xcbf29ce484222325u;
};

/// The tags of a contact of a list. Null: the list does not have it, or no tags.
template <class Contact>
const ContactTags* tagsIn(ContactKind kind, std::span<const Contact> list,
                          std::span<const ContactTags> tags, const Contact& contact) {
  if (tags.empty()) return nullptr;
  const auto place = std::lower_bound(
      list.begin(), list.end(), keyOf(kind, contact),
      [&](const Contact& l, const ContactKey& key) { return keyOf(kind, l) < key; });
  return place != list.end() && *place == contact
             ? &tags[static_cast<std::size_t>(place - list.begin())]
             : nullptr;
}

void addTo(Hash& hash, const VertexTriangleContact& c) {
  hash.add(c.vertex, c.triangle, c.weights, c.normal, c.distance, c.timeOfImpact,
           static_cast<std::uint64_t>(c.feature));
}
void addTo(Hash& hash, const EdgeEdgeContact& c) {
  hash.add(c.edgeA, c.edgeB, c.weightA, c.weightB, c.distance, c.timeOfImpact, c.normal,
           static_cast<std::uint64_t>(c.featureA) << 8 | static_cast<std::uint64_t>(c.featureB));
}
void addTo(Hash& hash, const ShapeContact& c) {
  hash.add(static_cast<std::uint64_t>(c.element) << 32 | c.id, c.vertices, c.weights, c.point,
           c.pointOnShape, c.normal, c.distance, c.timeOfImpact);
}
void addTo(Hash& hash, const ShapeShapeContact& c) {
  hash.add(c.pointA, c.pointB, c.normal, c.distance, c.timeOfImpact);
}

}  // namespace

CollisionData::CollisionData() noexcept = default;
CollisionData::CollisionData(const CollisionData& other)
    : m_contents(other.m_contents ? std::make_unique<Contents>(*other.m_contents) : nullptr) {
  if (m_contents) keepOffsets(*m_contents);
}
CollisionData::CollisionData(CollisionData&&) noexcept = default;
CollisionData& CollisionData::operator=(const CollisionData& other) {
  return *this = CollisionData(other);
}
CollisionData& CollisionData::operator=(CollisionData&&) noexcept = default;
CollisionData::~CollisionData() = default;

CollisionData::CollisionData(const Parts& parts) {
  Contents& contents = Contents::of(*this);
  const auto copy = [](auto& list, const auto& part) { list.assign(part.begin(), part.end()); };
  forEachContactList(contents,
                     [&](auto kind, auto& list) { copy(list, contactList<kind()>(parts)); });
  copy(contents.intersectingTriangles, parts.intersectingTriangles);
  contents.earliestTimeOfImpact = parts.earliestTimeOfImpact;
  contents.errorBound = parts.errorBound;
  contents.validity = parts.validity;
}

const CollisionData::Contents& CollisionData::read() const {
  static const Contents none;
  return m_contents ? *m_contents : none;
}

CollisionData::Parts CollisionData::parts() const {
  return {vertexTriangle(),
          triangleVertex(),
          edgeEdge(),
          intersectingTriangles(),
          shape(),
          shapeShape(),
          read().earliestTimeOfImpact,
          errorBound(),
          validity()};
}

std::span<const VertexTriangleContact> CollisionData::vertexTriangle() const {
  return read().vertexTriangle;
}
std::span<const VertexTriangleContact> CollisionData::triangleVertex() const {
  return read().triangleVertex;
}
std::span<const EdgeEdgeContact> CollisionData::edgeEdge() const { return read().edgeEdge; }
std::span<const ElementPair> CollisionData::intersectingTriangles() const {
  return read().intersectingTriangles;
}
std::span<const ShapeContact> CollisionData::shape() const { return read().shape; }
std::span<const ShapeShapeContact> CollisionData::shapeShape() const { return read().shapeShape; }
std::span<const TrackedContact> CollisionData::trackedVertexTriangle() const {
  return read().columnsOf(ContactKind::VertexTriangle).tracked;
}
std::span<const TrackedContact> CollisionData::trackedTriangleVertex() const {
  return read().columnsOf(ContactKind::TriangleVertex).tracked;
}
std::span<const TrackedContact> CollisionData::trackedEdgeEdge() const {
  return read().columnsOf(ContactKind::EdgeEdge).tracked;
}
std::span<const TrackedContact> CollisionData::trackedShape() const {
  return read().columnsOf(ContactKind::Shape).tracked;
}
std::span<const TrackedContact> CollisionData::trackedShapeShape() const {
  return read().columnsOf(ContactKind::ShapeShape).tracked;
}
std::span<const TrackedContact> CollisionData::ended() const { return read().ended; }
std::span<const Crossing> CollisionData::crossings() const { return read().crossings; }
std::span<const ContactTags> CollisionData::tags(ContactKind kind) const {
  return read().columnsOf(kind).tags;
}
ContactTags CollisionData::tagsOf(const VertexTriangleContact& contact) const {
  constexpr ContactKind kFirst = ContactKind::VertexTriangle, kSecond = ContactKind::TriangleVertex;
  // Two contacts of both lists may be equal. Which one it is then depends on its place.
  const std::span<const VertexTriangleContact> second = triangleVertex();
  const std::less<> precedes;
  const bool isInSecond =
      !precedes(&contact, second.data()) && precedes(&contact, second.data() + second.size());
  const ContactTags* found =
      isInSecond ? nullptr : tagsIn(kFirst, vertexTriangle(), tags(kFirst), contact);
  if (!found) found = tagsIn(kSecond, second, tags(kSecond), contact);
  return found ? *found : ContactTags{};
}
ContactTags CollisionData::tagsOf(const EdgeEdgeContact& contact) const {
  const ContactTags* const found =
      tagsIn(ContactKind::EdgeEdge, edgeEdge(), tags(ContactKind::EdgeEdge), contact);
  return found ? *found : ContactTags{};
}
ContactTags CollisionData::tagsOf(const ShapeContact& contact) const {
  const ContactTags* const found =
      tagsIn(ContactKind::Shape, shape(), tags(ContactKind::Shape), contact);
  return found ? *found : ContactTags{};
}
ContactTags CollisionData::tagsOf(const ShapeShapeContact& contact) const {
  const ContactTags* const found =
      tagsIn(ContactKind::ShapeShape, shapeShape(), tags(ContactKind::ShapeShape), contact);
  return found ? *found : ContactTags{};
}
std::span<const Eigen::Vector3d> CollisionData::smoothVertexTriangle() const {
  return read().columnsOf(ContactKind::VertexTriangle).smooth;
}
std::span<const Eigen::Vector3d> CollisionData::smoothTriangleVertex() const {
  return read().columnsOf(ContactKind::TriangleVertex).smooth;
}
std::span<const Eigen::Vector3d> CollisionData::smoothEdgeEdge() const {
  return read().columnsOf(ContactKind::EdgeEdge).smooth;
}
std::span<const Eigen::Vector3d> CollisionData::smoothShape() const {
  return read().columnsOf(ContactKind::Shape).smooth;
}
std::span<const Crossing> CollisionData::rememberedSides() const { return read().rememberedSides; }
double CollisionData::errorBound() const { return read().errorBound; }
const Validity& CollisionData::validity() const { return read().validity; }

double CollisionData::earliestTimeOfImpact() const {
  const Contents& contents = read();
  double earliest = contents.earliestTimeOfImpact;
  forEachContactList(contents, [&](ContactKind, const auto& list) {
    for (const auto& contact : list) earliest = std::min(earliest, contact.timeOfImpact);
  });
  return earliest;
}

std::uint64_t CollisionData::hash() const {
  const Contents& contents = read();
  Hash hash;
  forEachMeshList(contents, [&](ContactKind, const auto& list) {
    hash.add(list.size());
    for (const auto& contact : list) addTo(hash, contact);
  });
  hash.add(contents.intersectingTriangles.size());
  for (const ElementPair& p : contents.intersectingTriangles)
    hash.add(std::uint64_t{p.a} << 32 | p.b);
  forEachShapeList(contents, [&](ContactKind, const auto& list) {
    for (const auto& contact : list) addTo(hash, contact);
  });
  if (const double earliest = contents.earliestTimeOfImpact; earliest <= 1.0) hash.add(earliest);
  return hash.value();
}

}  // namespace palpate
