// Part of <palpate/SpatialQueries.h>: contacts of a mesh at a pose of its own.
#include <palpate/SpatialQueries.h>

#include <palpate/Error.h>

#include "Queries/QuerySource.h"
#include "Contact/ContactLists.h"
#include "NarrowPhase/NarrowPhase.h"
#include "Contact/Order.h"
#include "Bodies/Body.h"
#include "Bodies/InputChecks.h"
#include "Bodies/OctreeFrame.h"
#include "Octree/Traversal.h"
#include "Core/FloatingPoint.h"

#include <algorithm>
#include <memory>
#include <utility>

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

  const Body& place(const Pose& pose, const Body& beside, const OctreeSettings& settings) {
    body.mesh.now.place(pose, body.revisions.counter.next());
    body.mesh.before.placeAs(body.mesh.now);
    const double scale = beside.tree.frame().scale;
    const Revision topology = body.revisions.elements.topology;
    if (!body.tree.isCurrent(body.mesh, topology, scale)) {
      body.tree.sampleFrame(body.mesh, topology);
      body.tree.update(body.mesh, topology, scale, settings, one);
    }
    body.tree.updateDops(body.mesh, settings.bounds, one);
    return body;
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

  Body body{GeometryId{0}};
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
  Body& body = m_implementation->body;
  checkCounts(body, positions.size(), triangles, GeometryType::Triangles);
  body.mesh.rest = checkedRest(body, positions);
  body.mesh.topology = MeshTopology(positions.size(), triangles);
  body.mesh.now.setBody(std::make_shared<const CountedVector<Eigen::Vector3d>>(body.mesh.rest),
                        body.revisions.counter.next());
  body.mesh.before.setBodyOf(body.mesh.now);
  body.revisions.elements.topology = body.revisions.counter.next();
}
RigidMesh::RigidMesh(RigidMesh&&) noexcept = default;
RigidMesh& RigidMesh::operator=(RigidMesh&&) noexcept = default;
RigidMesh::~RigidMesh() = default;

void SpatialQueries::contacts(GeometryId id, RigidMesh& mesh, const Pose& placement,
                              double thickness, CollisionData& out) const {
  const Source::Call source(*this);
  if (!mesh.m_implementation)
    throw Error(ErrorCode::InvalidCall, "this RigidMesh object was moved from");
  const Pose pose = checkedPose(placement, "the query's mesh");
  checkLength(thickness, "thickness", true);
  const Body& a = source->at(id);
  checkHasElements(a);
  RigidMesh::Implementation& all = *mesh.m_implementation;
  const Body& b = all.place(pose, a, source->octreeSettings());
  all.found.clear();
  const MeshPair pair{a.mesh, b.mesh, {Method::Proximity, thickness}};
  RigidMesh::Implementation::Job job{pair, all};
  const auto countA = static_cast<std::uint32_t>(a.mesh.topology.elements.size()),
             countB = static_cast<std::uint32_t>(b.mesh.topology.elements.size());
  if (source->engine() == Engine::BruteForce)
    all.findByBruteForce(countA, countB, job);
  else if (a.mesh.topology.count() > 0 && countB > 0)
    all.findByOctree(a, b, job);
  ContactBuffers* const buffers[] = {&all.found};
  orderContacts(buffers, 0, all.order, all.sorted);
  CollisionData::Contents& sorted = all.sorted;
  sorted.validity = {};
  sorted.validity.method = Method::Proximity;
  sorted.validity.effectiveThickness = thickness;
  sorted.validity.atEnd = contactCount(sorted);
  std::swap(CollisionData::Contents::of(out), sorted);
}

}  // namespace palpate
