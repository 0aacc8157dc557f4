#include "Queries/Embedding.h"

#include "Math/TetrahedronWeights.h"
#include "Core/Assert.h"

namespace palpate {

void updateTetrahedra(const Body& solid, const OctreeSettings& settings, const Threads& threads) {
  PreparedData& prepared = *solid.prepared;
  auto& version = prepared.tetrahedraVersion;
  const FloatFrame& frame = solid.tree.frame();
  const PreparedData::TetrahedraState now{solid.revisions.elements.topology,
                                          solid.mesh.now.bodyRevision(), frame};
  if (version.isCurrent(now)) return;
  if (!prepared.tetrahedra || version.state().topology != now.topology)
    prepared.tetrahedra.emplace();
  version.invalidate();
  prepared.tetrahedra->update(solid.solid->topology, solid.tree.floats().now(),
                              solid.tree.spread() * frame.scale, settings, threads);
  version.commit(now);
}

std::optional<TetrahedronPoint> SolidQuery::lowest(const Eigen::Vector3d& p) {
  PALPATE_ASSERT(m_solid.prepared->tetrahedraVersion.isValid());
  const TetrahedralTopology& topology = m_solid.solid->topology;
  const Positions& now = m_solid.mesh.now;
  std::optional<TetrahedronPoint> best;
  SignCounts counts;
  const auto testOne = [&](std::uint32_t id, const Tetrahedron& t) {
    if (best && best->tetrahedron < id) return;
    if (const auto weights =
            tetrahedronWeights(p, now[t[0]], now[t[1]], now[t[2]], now[t[3]], counts))
      best = {id, t, *weights};
  };
  if (m_bruteForce) {
    topology.forEach([&](std::uint32_t i) { testOne(i, topology.tetrahedra[i]); });
    return best;
  }
  const TetrahedronTree& tree = *m_solid.prepared->tetrahedra;
  if (tree.octree().size() == 0) return best;
  findOverlapping(tree.octree(), m_frame.map(), m_frame.boxOf(p), m_stack);
  for (const std::uint32_t i : m_stack.found) testOne(tree.octree().order()[i], tree.ordered()[i]);
  return best;
}

void findEmbedded(const Body& vertices, const Body& solid, Engine engine, const Threads& threads,
                  VertexSearch<EmbeddedVertex>& scratch, std::vector<EmbeddedVertex>& out) {
  searchVertices(vertices.mesh.topology, threads, scratch, out, [&](PointQueryStack& stack) {
    return [&, query = SolidQuery(solid, engine, stack)](
               std::uint32_t v) mutable -> std::optional<EmbeddedVertex> {
      const auto at = query.lowest(vertices.mesh.now[v]);
      if (!at) return {};
      return EmbeddedVertex{v, *at};
    };
  });
}

}  // namespace palpate
