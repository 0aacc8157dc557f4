#include "Search/FreeMotionWork.h"

#include "Queries/ElementsNearShape.h"
#include "Shapes/ShapeFreeMotion.h"
#include "Bodies/OctreeFrame.h"
#include "Core/Stopping.h"

#include <cmath>
#include <cstdint>
#include <numeric>

namespace palpate {

namespace {

/// L: bounds the magnitudes of all coordinates in the world.
double largestOf(const Body& body) {
  if (body.shape) return body.shape->now.magnitude();
  return OctreeFrame(body).magnitude() + std::sqrt(3.0) * body.tree.reach();
}

}  // namespace

FreeMotionWork::FreeMotionWork(const Question& question, const FreeMotions& motions)
    : m_question(&question),
      m_motions(motions),
      m_range{question.settings(), question.a.mesh.largestRadius + question.b.mesh.largestRadius},
      m_searchDistance(m_range.searchDistance(largestOf(question.a) + largestOf(question.b))) {}

std::size_t FreeMotionWork::start(const FrameStart& frame) {
  m_byBruteForce = frame.engine == Engine::BruteForce;
  if (m_byBruteForce || m_question->hasShape()) return 1;
  const Body &a = m_question->a, &b = m_question->b;
  return m_traversal.start(treesOf(a, b, m_searchDistance, false),
                           a.tree.octree().size() + b.tree.octree().size(), frame);
}

void FreeMotionWork::run(int, std::size_t job, JobScratch& scratch) const {
  if (m_question->hasShape()) return withShape(scratch);
  // The settings that the user gave: Auto's choice may change in the next frame.
  MeshPair meshes = m_question->meshes();
  meshes.settings = m_question->settings();
  if (m_byBruteForce) return runByBruteForce(meshes, scratch);
  m_traversal.forEachBatch(job, scratch, [&](std::span<const ElementPair> pairs) {
    forEachPart(pairs, [&](const auto& part) {
      findFreeMotion(meshes, m_searchDistance, part, m_motions);
    });
  });
}

void FreeMotionWork::runByBruteForce(const MeshPair& pair, JobScratch& scratch) const {
  const auto countA = static_cast<std::uint32_t>(pair.a.topology.elements.size()),
             countB = static_cast<std::uint32_t>(pair.b.topology.elements.size());
  for (std::uint32_t i = 0; i < countA; ++i) {
    scratch.kept.clear();
    for (std::uint32_t j = pair.self() ? i + 1 : 0; j < countB; ++j) scratch.kept.push_back({i, j});
    findFreeMotion(pair, m_searchDistance, scratch.kept, m_motions);
  }
}

void FreeMotionWork::withShape(JobScratch& scratch) const {
  const Body &a = m_question->a, &b = m_question->b;
  if (a.shape && b.shape)
    return findFreeMotion(a.shape->now, b.shape->now, m_range, scratch.contacts.shapes.shapePair,
                          m_motions.a[0], m_motions.b[0]);
  const Body& mesh = m_question->mesh();
  const Shape& shape = m_question->shape().shape->now;
  if (m_byBruteForce) {
    scratch.elements.resize(mesh.mesh.topology.elements.size());
    std::iota(scratch.elements.begin(), scratch.elements.end(), 0u);
  } else {
    findElementsNear(mesh, shape, shape, m_searchDistance, scratch.elements);
  }
  const bool ofA = &mesh == &a;
  findFreeMotion(mesh.mesh, shape, m_range, scratch.elements, ofA ? m_motions.a : m_motions.b,
                 (ofA ? m_motions.b : m_motions.a)[0]);
}

}  // namespace palpate
