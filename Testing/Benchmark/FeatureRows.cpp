// Feature candidates as one arrow, through the rooms' own functions: positions to boxes, octree,
// triangle pairs and the vertex-triangle and edge-edge pairs that they own, batch by batch.
#include "Rows.h"

#include "CollisionDetection/GeometryTable.h"
#include "NarrowPhase/FeaturePairs.h"
#include "Octree/Traversal.h"

namespace palpate::benchmark {
namespace {

class FeatureCandidates {
 public:
  FeatureCandidates(const Workload& workload, bool swept)
      : m_threads(1),
        m_id(m_table.add(workload.frames[0][0], workload.task.meshes[0])),
        m_geometry(m_table.at(m_id)) {
    m_geometry.swept = swept;
  }

  void frame(const std::vector<Eigen::Vector3d>& before, const std::vector<Eigen::Vector3d>& now) {
    vertexTriangle = edgeEdge = 0;
    m_table.setPositions(m_id, before, now);
    m_table.updateOctrees({}, m_threads);
    TreePair trees{&m_geometry.octree, &m_geometry.octree};
    setShift(trees, {0, 0, 0}, 0);
    m_floats = {m_geometry.floats.data(), m_geometry.floats.data(), nullptr, nullptr,
                trees.shiftLower,         trees.shiftUpper};
    if (m_geometry.swept) m_floats.beforeA = m_floats.beforeB = m_geometry.floatsBefore.data();
    startPairs(trees, 1, m_stack);
    m_nodePairs.assign(m_stack.pairs.begin(), m_stack.pairs.end());
    m_sink.start(&receive, this);
    traverse(trees, m_nodePairs, m_stack, m_sink);
    m_sink.flush();
    m_table.endFrame();
  }

  std::size_t vertexTriangle = 0, edgeEdge = 0;

 private:
  static void receive(void* context, std::span<const TrianglePair> pairs) {
    auto& self = *static_cast<FeatureCandidates*>(context);
    const MeshTopology& topology = self.m_geometry.mesh.topology;
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

}  // namespace

void featureRows(Report& report, const RowOptions& options) {
  report.heading("Feature candidates of the published steps, consumed in batches; 1 thread");
  report.line({"", "ms", "vertex-tri", "edge-edge"});
  for (const std::string& name : workloadNames(options.sharedData)) {
    if (name != "cloth-funnel" && name != "rod-twist") continue;
    const Workload workload = makeWorkload(name, 2, options.sharedData);
    const auto &first = workload.frames[0][0], &second = workload.frames[1][0];
    for (const bool swept : {false, true}) {
      FeatureCandidates candidates(workload, swept);
      std::vector<double> samples;
      for (int i = 0; i < 1 + 4 * options.measure.repetitions; ++i) {
        const double start = now();
        candidates.frame(first, second);
        samples.push_back(now() - start);
      }
      const char* kind = swept ? "swept over the step" : "static";
      report.line({name + ", " + kind, milliseconds(median(samples)),
                   std::to_string(candidates.vertexTriangle), std::to_string(candidates.edgeEdge)});
      const auto row = [&](const char* metric, double value) {
        report.row("features", name, 1, kind, metric, value);
      };
      row("ms", median(samples));
      row("vertex-triangle", static_cast<double>(candidates.vertexTriangle));
      row("edge-edge", static_cast<double>(candidates.edgeEdge));
    }
  }
}

}  // namespace palpate::benchmark
