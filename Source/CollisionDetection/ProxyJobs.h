#pragma once

#include "CollisionDetection/JobScratch.h"
#include "CollisionDetection/PairTable.h"
#include "DistanceField/PlacedProxy.h"
#include "Core/Assert.h"

#include <algorithm>
#include <cstddef>
#include <optional>

namespace palpate {

/// The particles of a pair, in jobs of equal size, and the proxy that answers them.
class ProxyJobs {
 public:
  /// Places the proxy of the pair's body. Returns the number of jobs. thickness: L. divides: jobs
  /// are small, for a deadline. step: see PlacedProxy::find().
  std::size_t start(const PairRecord& record, const SurfaceProxy* proxy, double thickness,
                    bool divides, const std::optional<ProxyStep>& step = {}) {
    PALPATE_ASSERT(proxy != nullptr);
    m_points = &record.a->body.mesh;
    m_step = step;
    m_particlesPerJob = divides ? kParticlesPerSmallJob : kParticlesPerJob;
    m_proxy.emplace(*proxy, record.b->body.mesh, thickness);
    return (m_points->now.size() + m_particlesPerJob - 1) / m_particlesPerJob;
  }
  /// Finds the hits of a job's particles.
  void find(std::size_t job, JobScratch& scratch) const {
    const std::size_t begin = job * m_particlesPerJob;
    PALPATE_ASSERT(begin < m_points->now.size());
    find(begin, std::min(m_points->now.size(), begin + m_particlesPerJob), false, scratch);
  }
  /// Finds those of all particles, whose leaves it finds among all leaves.
  void findByBruteForce(JobScratch& scratch) const { find(0, m_points->now.size(), true, scratch); }
  /// Writes a contact for each hit of a job.
  void write(const JobScratch& scratch, ShapeContact* out) const {
    m_proxy->write(*m_points, scratch.hits, out);
  }
  /// Writes the depth and the error bound of the answer.
  void describe(Jobs jobs, CollisionData::Contents& contents) const {
    double error = 0;
    for (const auto& job : jobs) error = std::max(error, job->hits.error);
    contents.validity.proxyDepth = m_proxy->depth();
    contents.errorBound = jobs.empty() ? 0.0 : m_proxy->totalError(error);
  }

 private:
  static constexpr std::size_t kParticlesPerJob = 16384, kParticlesPerSmallJob = 1024;

  void find(std::size_t begin, std::size_t end, bool byBruteForce, JobScratch& scratch) const {
    PALPATE_ASSERT(m_proxy && begin <= end);
    m_proxy->find(*m_points, begin, end, byBruteForce, m_step ? &*m_step : nullptr, scratch.hits);
    scratch.contacts.featurePairs += scratch.hits.answered;
  }

  const TriangleMesh* m_points = nullptr;
  std::size_t m_particlesPerJob = kParticlesPerJob;
  std::optional<PlacedProxy> m_proxy;
  std::optional<ProxyStep> m_step;
};

}  // namespace palpate
