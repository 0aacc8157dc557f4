#include <palpate/SpatialQueries.h>

#include <palpate/Error.h>

#include "CollisionDetection/GeometryTable.h"
#include "CollisionDetection/Order.h"
#include "Core/FloatingPoint.h"
#include "NarrowPhase/NarrowPhase.h"
#include "Octree/Traversal.h"
#include "Queries/QuerySource.h"

#include <algorithm>
#include <utility>

// Contacts of a mesh at a pose of its own. This query is here, because it runs the narrow phase.
namespace palpate {

struct RigidMesh::Implementation {
  /// Appends the contacts of candidate pairs of elements.
  struct Job {
    const MeshPair& pair;
    Implementation& all;

    static void receive(void* context, std::span<const ElementPair> pairs) {
      const auto& [pair, all] = *static_cast<Job*>(context);
      const MeshTopology& topology = pair.a.topology;
      all.candidates.assign(pairs.begin(), pairs.end());
      std::erase_if(all.candidates, [&](ElementPair p) { return !topology.isEnabled(p.a); });
      findContacts(pair, all.candidates, all.found);
    }
  };

  Geometry& place(const RigidTransform& pose, const Body& beside, const OctreeSettings& settings) {
    Geometry& mesh = *table.all().front();
    table.setTransform(mesh.body.id, std::nullopt, pose);
    const double scale = beside.tree.frame().scale;
    if (!mesh.body.tree.isCurrent(mesh.body.mesh, mesh.body.revisions.elements.topology, scale)) {
      mesh.body.tree.sampleFrame(mesh.body.mesh, mesh.body.revisions.elements.topology);
      mesh.body.tree.update(mesh.body.mesh, mesh.body.revisions.elements.topology, scale, settings,
                            one);
    }
    mesh.body.tree.updateDops(mesh.body.mesh, settings.bounds, one);
    return mesh;
  }
  void findByOctree(const Body& a, const Body& b, Job& job) {
    const TreePair trees = treesOf(a, b, job.pair.maxFeatureDistance(), false, BoxFrame::Body);
    startPairs(trees, 1, stack);
    startNodes.assign(stack.pairs.begin(), stack.pairs.end());
    sink.start(&Job::receive, &job);
    traverse(trees, startNodes, stack, sink);
    sink.flush();
  }
  void findByBruteForce(std::uint32_t countA, std::uint32_t countB, Job& job) {
    for (std::uint32_t b = 0; b < countB; ++b) {
      pairs.clear();
      for (std::uint32_t a = 0; a < countA; ++a) pairs.push_back({a, b});
      Job::receive(&job, pairs);
    }
  }

  GeometryTable table;  ///< holds the mesh alone
  const Threads one{1};
  TraversalStack stack;
  PairSink sink;
  Buffer<NodePair> startNodes;
  Buffer<ElementPair> pairs, candidates;
  ContactBuffers found;
  OrderScratch order;
  CollisionData::Contents sorted;
};

RigidMesh::RigidMesh(std::span<const Eigen::Vector3d> positions,
                     std::span<const Triangle> triangles)
    : m_implementation(std::make_unique<Implementation>()) {
  m_implementation->table.add(positions, triangles);
}
RigidMesh::RigidMesh(RigidMesh&&) noexcept = default;
RigidMesh& RigidMesh::operator=(RigidMesh&&) noexcept = default;
RigidMesh::~RigidMesh() = default;

void SpatialQueries::contacts(GeometryId id, RigidMesh& mesh, const Eigen::Matrix3d& rotation,
                              const Eigen::Vector3d& translation, double thickness,
                              CollisionData& out) const {
  Source& source = valid();
  const StandardFloatingPoint standard;
  if (!mesh.m_implementation)
    throw Error(ErrorCode::InvalidCall, "this RigidMesh object was moved from");
  const RigidTransform pose = checkedPose({rotation, translation}, "the query's mesh");
  checkLength(thickness, "thickness", true);
  const Body& a = source.at(id);
  checkHasElements(a);
  RigidMesh::Implementation& all = *mesh.m_implementation;
  const Geometry& b = all.place(pose, a, source.octreeSettings());
  all.found.clear();
  const MeshPair pair{a.mesh, b.body.mesh, {Method::Proximity, thickness}};
  RigidMesh::Implementation::Job job{pair, all};
  const auto countA = static_cast<std::uint32_t>(a.mesh.topology.triangles.size()),
             countB = static_cast<std::uint32_t>(b.body.mesh.topology.triangles.size());
  if (source.engine() == Engine::BruteForce)
    all.findByBruteForce(countA, countB, job);
  else if (countA > 0 && countB > 0)
    all.findByOctree(a, b.body, job);
  ContactBuffers* const buffers[] = {&all.found};
  orderContacts(buffers, 0, all.order, all.sorted);
  CollisionData::Contents& sorted = all.sorted;
  sorted.validity = {};
  sorted.validity.method = Method::Proximity;
  sorted.validity.effectiveThickness = thickness;
  sorted.validity.atEnd =
      sorted.vertexTriangle.size() + sorted.triangleVertex.size() + sorted.edgeEdge.size();
  std::swap(out.contents(), sorted);
}

}  // namespace palpate
