#include "CollisionDetection/AttachedProxyWork.h"

#include "CollisionDetection/DiagnosticsInterface.h"
#include "CollisionDetection/PairResults.h"
#include "Queries/ElementsNearShape.h"
#include "Core/Assert.h"
#include "Core/MemoryBudget.h"
#include "Core/Stopping.h"
#include "Core/Stopwatch.h"

#include <algorithm>
#include <limits>
#include <optional>

namespace palpate {

namespace {

/// Makes the contacts of the exact method such of a body, too. Both lists are in the order of
/// particles.
void describeAsShape(const TriangleMesh& points, CollisionData::Contents& contents) {
  auto& exact = contents.vertexTriangle;
  auto& all = contents.shape;
  PALPATE_ASSERT(std::is_sorted(exact.begin(), exact.end(),
                                [](const auto& a, const auto& b) { return a.vertex < b.vertex; }));
  PALPATE_ASSERT(std::is_sorted(all.begin(), all.end(),
                                [](const auto& a, const auto& b) { return a.id < b.id; }));
  std::size_t byProxy = all.size(), left = exact.size();
  all.resize(byProxy + left);
  for (std::size_t place = all.size(); left > 0;) {
    if (byProxy > 0 && all[byProxy - 1].id > exact[left - 1].vertex) {
      all[--place] = all[--byProxy];
      continue;
    }
    const VertexTriangleContact& contact = exact[--left];
    const std::uint32_t v = contact.vertex;
    const double time = contact.timeOfImpact;
    const Eigen::Vector3d point = (1.0 - time) * points.before[v] + time * points.now[v];
    all[--place] = {ShapeElement::Vertex,
                    v,
                    {v, v, v},
                    Eigen::Vector3d::UnitX(),
                    point,
                    point - (contact.distance + points.radius(v)) * contact.normal,
                    contact.normal,
                    contact.distance,
                    time};
  }
  exact.clear();
}

}  // namespace

std::size_t AttachedProxyWork::place(bool divides) {
  const PairPlan& plan = m_record->plan;
  std::optional<ProxyStep> step;
  if (plan.motion > 0.0)
    step = {m_record->b->motion.range(), m_record->pair.settings.thickness, plan.motionTolerance};
  return m_proxyJobs.start(*m_record, m_record->b->proxy.get(), plan.proxyThickness, divides, step);
}

std::size_t AttachedProxyWork::start(const FrameStart&) { return place(isTimed()); }

void AttachedProxyWork::run(int, std::size_t job, JobScratch& scratch) const {
  const MemoryScope memory(MemoryStage::NarrowPhase);
  const AddedTime time(scratch.narrowMilliseconds);
  m_proxyJobs.find(job, scratch);
  writeHits(scratch);
  findOthers(scratch);
}

void AttachedProxyWork::runByBruteForce(JobScratch& scratch) {
  place(false);
  m_proxyJobs.findByBruteForce(scratch);
  writeHits(scratch);
  detectVerticesByBruteForce(*m_record, scratch.hits.others, scratch.contacts);
}

void AttachedProxyWork::writeHits(JobScratch& scratch) const {
  auto& found = scratch.contacts.shapes.shape;
  PALPATE_ASSERT(std::is_sorted(scratch.hits.others.begin(), scratch.hits.others.end()));
  found.resize(scratch.hits.count);
  m_proxyJobs.write(scratch, found.data());
}

void AttachedProxyWork::findOthers(JobScratch& scratch) const {
  const TriangleMesh& points = m_record->a->body.mesh;
  const MeshPair meshes = m_record->meshes();
  const bool swept = m_record->plan.swept();
  const auto isDisabled = [&](const ElementPair& p) {
    return !m_record->b->body.mesh.topology.isEnabled(p.b);
  };
  for (const std::uint32_t point : scratch.hits.others) {
    checkTime();
    Eigen::AlignedBox3d box(points.now[point]);
    if (swept) box.extend(points.before[point]);
    const Eigen::Vector3d margin = Eigen::Vector3d::Constant(meshes.maxFeatureDistance());
    findElementsNear(m_record->b->body, {box.min() - margin, box.max() + margin}, swept,
                     scratch.elements);
    scratch.kept.clear();
    for (const std::uint32_t element : scratch.elements) scratch.kept.push_back({point, element});
    std::erase_if(scratch.kept, isDisabled);
    if (!scratch.kept.empty()) findContacts(meshes, scratch.kept, scratch.contacts);
  }
}

void AttachedProxyWork::join(Jobs jobs, const FrameJoin& join) const {
  PairRecord& record = *m_record;
  PairResults& results = join.results;
  const bool continuous = record.plan.method == Method::Continuous;
  results.start(jobs);
  for (const ContactBuffers* found : results.found()) results.facts().add(found->facts);
  results.sortFacts(record);
  results.order(record);
  CollisionData::Contents& contents = CollisionData::Contents::of(record.next);
  describeExact(contents);
  m_proxyJobs.describe(jobs, contents);
  results.assess(record, false, join.statistics);
  if (continuous) results.keepFirstImpacts(record, std::numeric_limits<double>::infinity());
  countContacts(continuous ? contents.vertexTriangle.size() : 0, contents);
  describeAsShape(record.a->body.mesh, contents);
  contents.step.endRows.clear();
}

}  // namespace palpate
