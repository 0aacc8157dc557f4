// Feature candidates as one stage, through internal functions: positions, boxes, octree, triangle
// pairs, and the vertex-triangle and edge-edge pairs that they own, batch by batch. Baselines are
// Embree's triangle pairs of the same frame, and the fastest engine of the IPC toolkit, swept. The
// latter was measured elsewhere on this class of machine. Its times are scaled by Embree's time
// here over its time there.
#include "Rows.h"

#include "CollisionDetection/GeometryTable.h"
#include "NarrowPhase/FeaturePairs.h"
#include "Octree/Traversal.h"

#include <algorithm>
#include <memory>

namespace palpate::benchmark {
namespace {

/// Milliseconds by one thread.
struct Reference {
  const char* scene;
  double embree;  ///< rebuild + collide
  double lbvh;    ///< IPC toolkit's LBVH, boxes swept over the step
};
constexpr Reference kReferences[] = {{"cloth-funnel", 15.8, 21}, {"rod-twist", 121, 172}};
constexpr double kTimesLbvh = 3;

class FeatureCandidates {
 public:
  FeatureCandidates(const Workload& workload, bool swept)
      : m_threads(1),
        m_id(m_table.add(
            m_table.builder().triangles(workload.frames[0][0], workload.task.meshes[0]))),
        m_geometry(m_table.at(m_id)) {
    m_geometry.body.tree.setSwept(swept);
  }

  void frame(const std::vector<Eigen::Vector3d>& before, const std::vector<Eigen::Vector3d>& now) {
    vertexTriangle = edgeEdge = 0;
    m_table.setPositions(m_id, before, now, m_threads);
    Body& body = m_geometry.body;
    GeometryOctree& tree = body.tree;
    const Revision topology = body.revisions.elements.topology;
    const double scale = frameScale(tree.sampleFrame(body.mesh, topology));
    tree.update(body.mesh, topology, scale, {}, m_threads);
    TreePair trees{&tree.octree(), &tree.octree()};
    setShift(trees, {0, 0, 0}, 0);
    m_floats = {tree.floats().now(), tree.floats().now(), nullptr, nullptr,
                trees.shiftLower,    trees.shiftUpper};
    if (tree.isSwept()) m_floats.beforeA = m_floats.beforeB = tree.floats().atStart();
    startPairs(trees, 1, m_stack);
    m_nodePairs.assign(m_stack.pairs.begin(), m_stack.pairs.end());
    m_sink.start(&receive, this);
    traverse(trees, m_nodePairs, m_stack, m_sink);
    m_sink.flush();
    m_table.advance();
  }

  std::size_t vertexTriangle = 0, edgeEdge = 0;
  /// Bytes of triangle pairs and feature pairs in memory at once.
  std::size_t batchBytes() const {
    return m_sink.bytes() + sizeof(FeaturePair) * (m_features.vertexTriangle.capacity() +
                                                   m_features.triangleVertex.capacity() +
                                                   m_features.edgeEdge.capacity());
  }

 private:
  static void receive(void* context, std::span<const ElementPair> pairs) {
    auto& self = *static_cast<FeatureCandidates*>(context);
    const MeshTopology& topology = self.m_geometry.body.mesh.topology;
    findFeaturePairs(topology, topology, &self.m_floats, pairs, self.m_features);
    self.vertexTriangle += self.m_features.vertexTriangle.size();
    self.edgeEdge += self.m_features.edgeEdge.size();
  }

  Threads m_threads;
  GeometryTable m_table;
  GeometryId m_id;
  Geometry& m_geometry;
  FloatPair m_floats;
  TraversalStack m_stack;
  std::vector<NodePair> m_nodePairs;
  PairSink m_sink;
  FeaturePairs m_features;
};

/// Median milliseconds, in turns.
struct Medians {
  double kinds[2] = {}, embree = 0;
};

Medians takeTurns(const Workload& workload, FeatureCandidates (&kinds)[2],
                  const MeasureOptions& options) {
  const auto &first = workload.frames[0][0], &second = workload.frames[1][0];
  std::vector<double> times[2], embree;
#ifdef PALPATE_BENCHMARK_BASELINES
  const auto embreeRebuild = makeEmbreeMorton();
  embreeRebuild->prepare(workload.task, workload.frames[0]);
#endif
  for (int repetition = 0; repetition < 1 + 2 * options.repetitions; ++repetition) {
    for (int swept = 0; swept < 2; ++swept) {
      kinds[swept].frame(second, first);  // so that the positions change
      const double start = now();
      kinds[swept].frame(first, second);
      if (repetition > 0) times[swept].push_back(now() - start);
    }
#ifdef PALPATE_BENCHMARK_BASELINES
    for (const Positions& frame : workload.frames) {
      const double start = now();
      embreeRebuild->update(frame);
      embreeRebuild->collide();
      if (repetition > 0) embree.push_back(now() - start);
    }
#endif
  }
  return {{median(times[0]), median(times[1])}, median(embree)};
}

void rowsOf(Report& report, const Reference& reference, const Workload& workload,
            const MeasureOptions& options) {
  FeatureCandidates kinds[2] = {{workload, false}, {workload, true}};
  const Medians medians = takeTurns(workload, kinds, options);
  report.line({workload.name + ", Embree", milliseconds(medians.embree)});
  report.row("features", workload.name, 1, "Embree rebuild + collide", "ms", medians.embree);
  for (int swept = 0; swept < 2; ++swept) {
    const char* kind = swept ? "swept over the step" : "static";
    const FeatureCandidates& candidates = kinds[swept];
    const double lbvh = reference.lbvh * medians.embree / reference.embree;
    const auto row = [&](const char* metric, double value) {
      report.row("features", workload.name, 1, kind, metric, value);
    };
    row("ms", medians.kinds[swept]);
    row("vertex-triangle", static_cast<double>(candidates.vertexTriangle));
    row("edge-edge", static_cast<double>(candidates.edgeEdge));
    row("batch bytes", static_cast<double>(candidates.batchBytes()));
    std::vector<std::string> cells = {
        workload.name + ", " + kind, milliseconds(medians.kinds[swept]),
        std::to_string(candidates.vertexTriangle), std::to_string(candidates.edgeEdge),
        std::to_string(candidates.batchBytes())};
    if (lbvh > 0) {
      row("target ms", lbvh / kTimesLbvh);
      row("speed-up over LBVH", lbvh / medians.kinds[swept]);
      cells.insert(cells.end(),
                   {milliseconds(lbvh / kTimesLbvh), times(lbvh / medians.kinds[swept]),
                    lbvh >= kTimesLbvh * medians.kinds[swept] ? "met" : "NOT MET"});
    }
    report.line(cells);
  }
}

}  // namespace

void featureRows(Report& report, const RowOptions& options) {
  report.heading("Feature candidates of the published steps, in batches; 1 thread");
  report.line({"", "ms", "vertex-tri", "edge-edge", "batch bytes", "target", "over LBVH"});
  const std::vector<std::string> names = workloadNames(options.sharedData);
  for (const Reference& reference : kReferences)
    if (std::find(names.begin(), names.end(), reference.scene) != names.end())
      rowsOf(report, reference, makeWorkload(reference.scene, 2, options.sharedData),
             options.measure);
}

std::size_t featureCandidates(const Workload& workload) {
  FeatureCandidates candidates(workload, true);
  candidates.frame(workload.frames[0][0], workload.frames[1][0]);
  return candidates.vertexTriangle + candidates.edgeEdge;
}

}  // namespace palpate::benchmark
