#include <palpate/CollisionData.h>

#include <algorithm>
#include <bit>

namespace palpate {

namespace {

/// FNV-1a over 64-bit words.
class Hash {
 public:
  void add(std::uint64_t word) {
    for (int i = 0; i < 64; i += 8) m_value = (m_value ^ (word >> i & 0xff)) * 0x100000001b3u;
  }
  void add(double value) { add(std::bit_cast<std::uint64_t>(value)); }
  void add(const Eigen::Vector3d& vector) {
    for (int k = 0; k < 3; ++k) add(vector[k]);
  }
  std::uint64_t value() const { return m_value; }

 private:
  std::uint64_t m_value = 0xcbf29ce484222325u;
};

void addAll(Hash& hash, std::span<const VertexTriangleContact> contacts) {
  hash.add(std::uint64_t{contacts.size()});
  for (const VertexTriangleContact& c : contacts) {
    hash.add(std::uint64_t{c.vertex});
    hash.add(std::uint64_t{c.triangle});
    hash.add(c.barycentric);
    hash.add(c.normal);
    hash.add(c.distance);
    hash.add(c.timeOfImpact);
  }
}

}  // namespace

double CollisionData::earliestTimeOfImpact() const {
  double earliest = m_contents.earliestTimeOfImpact;
  for (const auto& c : m_contents.vertexTriangle) earliest = std::min(earliest, c.timeOfImpact);
  for (const auto& c : m_contents.triangleVertex) earliest = std::min(earliest, c.timeOfImpact);
  for (const auto& c : m_contents.edgeEdge) earliest = std::min(earliest, c.timeOfImpact);
  return earliest;
}

std::uint64_t CollisionData::hash() const {
  Hash hash;
  addAll(hash, m_contents.vertexTriangle);
  addAll(hash, m_contents.triangleVertex);
  hash.add(std::uint64_t{m_contents.edgeEdge.size()});
  for (const EdgeEdgeContact& c : m_contents.edgeEdge) {
    for (const std::uint32_t id : {c.edgeA[0], c.edgeA[1], c.edgeB[0], c.edgeB[1]})
      hash.add(std::uint64_t{id});
    for (const double v : {c.weightA, c.weightB, c.distance, c.timeOfImpact}) hash.add(v);
    hash.add(c.normal);
  }
  hash.add(std::uint64_t{m_contents.intersectingTriangles.size()});
  for (const TrianglePair& p : m_contents.intersectingTriangles)
    hash.add(std::uint64_t{p.a} << 32 | p.b);
  for (const ShapeContact& c : m_contents.shape) {
    hash.add(static_cast<std::uint64_t>(c.element) << 32 | c.id);
    for (const std::uint32_t id : c.vertices) hash.add(std::uint64_t{id});
    for (const auto& vector : {c.weights, c.point, c.pointOnShape, c.normal}) hash.add(vector);
    hash.add(c.distance);
  }
  for (const ShapeShapeContact& c : m_contents.shapeShape) {
    for (const auto& vector : {c.pointA, c.pointB, c.normal}) hash.add(vector);
    hash.add(c.distance);
  }
  if (const double earliest = m_contents.earliestTimeOfImpact; earliest <= 1.0) hash.add(earliest);
  return hash.value();
}

}  // namespace palpate
