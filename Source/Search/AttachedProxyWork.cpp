#include "Search/AttachedProxyWork.h"

#include "Search/BruteForce.h"
#include "Search/PairResults.h"
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

std::size_t AttachedProxyWork::start(const FrameStart& frame) {
  const Question& question = *m_search.question;
  const PairPlan& plan = question.plan;
  std::optional<ProxyStep> step;
  if (plan.motion > 0.0)
    step = {question.bInStep.range, question.settings().thickness, plan.motionTolerance};
  return m_proxyJobs.start(question, plan.proxyThickness, frame, step);
}

void AttachedProxyWork::run(int, std::size_t job, JobScratch& scratch) const {
  const MemoryScope memory(MemoryStage::NarrowPhase);
  const AddedTime time(scratch.narrowMilliseconds);
  m_proxyJobs.find(job, scratch);
  writeHits(scratch);
  if (m_proxyJobs.isByBruteForce())
    detectVerticesByBruteForce(*m_search.question, scratch.hits.others, scratch.contacts);
  else
    findOthers(scratch);
}

void AttachedProxyWork::writeHits(JobScratch& scratch) const {
  auto& found = scratch.contacts.shapes.shape;
  PALPATE_ASSERT(std::is_sorted(scratch.hits.others.begin(), scratch.hits.others.end()));
  found.resize(scratch.hits.count);
  m_proxyJobs.write(scratch, found.data());
}

void AttachedProxyWork::findOthers(JobScratch& scratch) const {
  const Question& question = *m_search.question;
  const TriangleMesh& points = question.a.mesh;
  const MeshPair meshes = question.meshes();
  const bool swept = question.plan.swept();
  const auto isDisabled = [&](const ElementPair& p) {
    return !question.b.mesh.topology.isEnabled(p.b);
  };
  for (const std::uint32_t point : scratch.hits.others) {
    checkTime();
    Eigen::AlignedBox3d box(points.now[point]);
    if (swept) box.extend(points.before[point]);
    const Eigen::Vector3d margin = Eigen::Vector3d::Constant(meshes.maxFeatureDistance());
    findElementsNear(question.b, {box.min() - margin, box.max() + margin}, swept, scratch.elements);
    scratch.kept.clear();
    for (const std::uint32_t element : scratch.elements) scratch.kept.push_back({point, element});
    std::erase_if(scratch.kept, isDisabled);
    if (!scratch.kept.empty()) findContacts(meshes, scratch.kept, scratch.contacts);
  }
}

void AttachedProxyWork::join(Jobs jobs, const FrameJoin& join) const {
  const Question& question = *m_search.question;
  PairResults& results = join.results;
  const bool continuous = question.plan.method == Method::Continuous;
  results.start(jobs);
  for (const ContactBuffers* found : results.found()) results.facts().add(found->facts);
  results.sortFacts(question);
  results.order(m_search);
  CollisionData::Contents& contents = m_search.answer->contents();
  describeExact(contents);
  m_proxyJobs.describe(jobs, contents);
  results.assess(m_search, false, join.statistics);
  if (continuous) results.keepFirstImpacts(m_search, std::numeric_limits<double>::infinity());
  countContacts(continuous ? contents.vertexTriangle.size() : 0, contents);
  describeAsShape(question.a.mesh, contents);
  contents.step.endRows.clear();
}

}  // namespace palpate
