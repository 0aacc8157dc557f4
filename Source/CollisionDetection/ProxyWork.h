#pragma once

#include "CollisionDetection/JobScratch.h"
#include "CollisionDetection/PairTable.h"
#include "DistanceField/PlacedProxy.h"

#include <cstddef>
#include <optional>

namespace palpate {

/// Particles of a job.
inline constexpr std::size_t kParticlesPerJob = 16384;

/// Work on particles by Method::Proxy. Contacts are written in join(), by all threads, to their
/// places in the results.
class ProxyWork {
 public:
  explicit ProxyWork(PairRecord& record) : m_record(&record) {}

  std::size_t start(const FrameStart&);
  bool hasRound(int round, Jobs) const { return round == 0; }
  void run(int round, std::size_t job, JobScratch&) const;
  void runByBruteForce(JobScratch&);
  void join(Jobs, const FrameJoin&) const;

 private:
  void place();
  void find(std::size_t begin, std::size_t end, bool byBruteForce, JobScratch&) const;

  PairRecord* m_record;
  std::optional<PlacedProxy> m_proxy;
};

/// Writes the depth and the error bound of an answer by leaves.
void describeProxy(const SurfaceProxy&, const PlacedProxy&, Jobs, CollisionData::Contents&);

}  // namespace palpate
