#pragma once

#include "Search/JobScratch.h"
#include "Search/Question.h"
#include "DistanceField/PlacedProxy.h"
#include "Core/Assert.h"

#include <algorithm>
#include <cstddef>
#include <optional>

namespace palpate {

/// The particles of a pair, in jobs of equal size, and the proxy that answers them.
class ProxyJobs {
 public:
  /// Places the proxy of the question. Returns the number of jobs. thickness: L. step: see
  /// PlacedProxy::find().
  std::size_t start(const Question& question, double thickness, const FrameStart& frame,
                    const std::optional<ProxyStep>& step = {}) {
    PALPATE_ASSERT(question.proxy != nullptr);
    m_byBruteForce = frame.engine == Engine::BruteForce;
    m_points = &question.a.mesh;
    m_step = step;
    m_particlesPerJob = isTimed() ? kParticlesPerSmallJob : kParticlesPerJob;
    m_proxy.emplace(*question.proxy, question.b.mesh, thickness);
    if (m_byBruteForce) return 1;
    return (m_points->now.size() + m_particlesPerJob - 1) / m_particlesPerJob;
  }
  /// Finds the hits of a job's particles.
  void find(std::size_t job, JobScratch& scratch) const {
    const std::size_t size = m_points->now.size();
    if (m_byBruteForce) return find(0, size, scratch);
    const std::size_t begin = job * m_particlesPerJob;
    PALPATE_ASSERT(begin < size);
    find(begin, std::min(size, begin + m_particlesPerJob), scratch);
  }
  bool isByBruteForce() const { return m_byBruteForce; }
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

  void find(std::size_t begin, std::size_t end, JobScratch& scratch) const {
    PALPATE_ASSERT(m_proxy && begin <= end);
    m_proxy->find(*m_points, begin, end, m_byBruteForce, m_step ? &*m_step : nullptr, scratch.hits);
    scratch.contacts.featurePairs += scratch.hits.answered;
  }

  const TriangleMesh* m_points = nullptr;
  bool m_byBruteForce = false;  ///< the leaves of a particle are found among all leaves
  std::size_t m_particlesPerJob = kParticlesPerJob;
  std::optional<PlacedProxy> m_proxy;
  std::optional<ProxyStep> m_step;
};

}  // namespace palpate
