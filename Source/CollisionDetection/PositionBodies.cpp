#include "CollisionDetection/PositionBodies.h"

#include "Mesh/TriangleMesh.h"
#include "Core/Buffer.h"

#include <algorithm>
#include <utility>
#include <vector>

namespace palpate {

/// Memory that nothing uses; if possible, memory from which few vertices of `like` are missing.
PositionBodies::Memory& PositionBodies::free(const Positions* like) {
  Memory* found = nullptr;
  for (const auto& body : m_bodies) {
    if (!body->isFree()) continue;
    if (!found) found = body.get();
    if (!like || (body->revision && like->changesSince(*body->revision))) return *body;
  }
  if (found) return *found;
  auto body = std::make_unique<Memory>();
  body->positions = std::make_shared<CountedVector<Eigen::Vector3d>>();
  return *m_bodies.emplace_back(std::move(body));
}

PositionBodies::Checked PositionBodies::checked(const GeometryLabel& label,
                                                std::span<const Eigen::Vector3d> positions,
                                                const char* which, const Threads& threads,
                                                const Eigen::Vector3d* from, MotionRange* moved) {
  Memory& memory = free();
  memory.revision.reset();
  if (positions.size() > memory.positions->capacity())
    memory.positions->reserve(withSpare(positions.size()));
  memory.positions->resize(positions.size());
  const auto bounds =
      checkPositions(label, positions, memory.positions->data(), which, threads, from, moved);
  return {&memory, memory.positions, bounds};
}

PositionBodies::Memory& PositionBodies::copyOf(const Positions& last) {
  const std::span<const Eigen::Vector3d> positions = last.body();
  Memory& memory = free(&last);
  VertexRange missing{0, positions.size()};
  if (memory.revision && memory.positions->size() == positions.size())
    missing = last.changesSince(*memory.revision).value_or(missing);
  memory.revision.reset();
  memory.positions->resize(positions.size());
  std::copy(positions.begin() + static_cast<std::ptrdiff_t>(missing.begin),
            positions.begin() + static_cast<std::ptrdiff_t>(missing.end),
            memory.positions->data() + missing.begin);
  return memory;
}

PositionBodies::Memory* PositionBodies::find(const Positions::Body& body) noexcept {
  const auto own = std::find_if(m_bodies.begin(), m_bodies.end(),
                                [&](const auto& memory) { return memory->positions == body; });
  return own == m_bodies.end() ? nullptr : own->get();
}

void PositionBodies::reserve(std::span<Positions* const> ends, std::size_t count) {
  for (Positions* end : ends) {
    const Positions::Body body = end->sharedBody();
    std::vector<Positions*> same;
    for (Positions* other : ends)
      if (other->sharedBody() == body) same.push_back(other);
    if (end != same.front()) continue;
    Memory* const own = find(body);
    const std::size_t size = body->size() + count;
    // These ends, the memory itself, and `body`.
    if (own && body.use_count() == static_cast<long>(same.size()) + 2) {
      reserveAmortized(*own->positions, size);
      for (Positions* other : same) other->findData();
      continue;
    }
    Memory& memory = free();
    memory.revision.reset();
    memory.positions->reserve(withSpare(size));
    memory.positions->assign(body->begin(), body->end());
    for (Positions* other : same) other->moveBody(memory.positions);
    memory.revision = end->bodyRevision();
  }
}

void PositionBodies::releaseMemory() {
  std::erase_if(m_bodies, [](const auto& body) { return body->isFree(); });
}

}  // namespace palpate
