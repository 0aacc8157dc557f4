#include "Score.h"

#include <algorithm>
#include <map>
#include <numbers>

namespace palpate::accuracy {

namespace {

double degreesBetween(const Eigen::Vector3d& u, const Eigen::Vector3d& v) {
  return 2 * std::atan2((u - v).norm(), (u + v).norm()) * 180 / std::numbers::pi;
}

std::size_t countOutside(const std::vector<ElementPair>& pairs,
                         const std::vector<ElementPair>& set) {
  return static_cast<std::size_t>(std::count_if(pairs.begin(), pairs.end(), [&](const auto& pair) {
    return !std::binary_search(set.begin(), set.end(), pair);
  }));
}

/// The impacts of each pair of triangles.
std::multimap<ElementPair, const Impact*> byTriangles(const Reference& reference,
                                                      const Incidence& a, const Incidence& b) {
  std::multimap<ElementPair, const Impact*> all;
  for (const auto& [features, impact] : reference.impacts) {
    if (!impact) continue;
    std::vector<ElementPair> triangles;
    Incidence::addTriangles(features, a, b, triangles);
    for (const ElementPair& pair : triangles) all.emplace(pair, &*impact);
  }
  return all;
}

/// The claim about features that touch, or its substitute; null if there is none.
const Claim* claimOf(const FeaturePair& features, const std::optional<Impact>& impact,
                     const std::map<FeaturePair, Claim>& claims, const Substitutes& substitutes,
                     const Incidence& a, const Incidence& b) {
  const auto claim = claims.find(features);
  if (claim != claims.end()) return &claim->second;
  const Claim* substitute = substitutes.find(features, a, b);
  constexpr double kTimeError = 1e-12;  // of the reference and of rounding
  const auto isInTime = [&](const Claim* other, double late) {
    return other && !(impact && other->time > impact->time + late);
  };
  if (isInTime(substitute, kTimeError)) return substitute;
  if (!impact) return nullptr;
  // One with a triangle's interior may be late by timeTolerance.
  substitute = substitutes.findBeside(
      features, a, b, [&](const Claim& other) { return other.normal.dot(impact->normal) >= 0; });
  return isInTime(substitute, ContinuousSettings{}.timeTolerance) ? substitute : nullptr;
}

}  // namespace

void Score::addErrors(const Claim& claim, const Impact& impact) {
  distance.add(100 * std::abs(claim.distance - impact.gapAt(claim.time)) / meanEdge);
  normal.add(degreesBetween(claim.normal, impact.normal));
  time.add(100 * std::abs(claim.time - impact.time));
}

void Score::add(const Reference& reference, const Claims& answer, const Incidence& a,
                const Incidence& b) {
  // If several claims are about the same features, the first in time counts.
  std::map<FeaturePair, Claim> first;
  for (const Claim& claim : answer.claims) {
    const auto [entry, isNew] = first.try_emplace(claim.features, claim);
    if (!isNew && claim.time < entry->second.time) entry->second = claim;
  }
  claims += first.size();
  const Substitutes substitutes(answer);
  std::vector<ElementPair> touching = answer.triangles;
  bool wrong = answer.ofTriangles && answer.triangles.empty() && !reference.touching.empty();
  for (const auto& [features, impact] : reference.impacts) {
    const Claim* claim = claimOf(features, impact, first, substitutes, a, b);
    // All triangles that share the touching features count as reported.
    if (claim) Incidence::addTriangles(features, a, b, touching);
    if (!answer.ofTriangles) wrong |= !claim || (impact && claim->normal.dot(impact->normal) < 0);
  }
  if (answer.trusted) {
    ++m_judged;
    wrongTrusted += wrong && *answer.trusted;
    m_rightUntrusted += !wrong && !*answer.trusted;
  }
  for (const auto& [features, claim] : first)
    if (!claim.example) Incidence::addTriangles(features, a, b, touching);
  sortUnique(touching);
  m_touching += reference.touching.size();
  m_claimed += touching.size();
  m_falseNegatives += countOutside(reference.touching, touching);
  m_touchingAtStart += reference.touchingAtStart.size();
  m_falseNegativesAtStart += countOutside(reference.touchingAtStart, touching);
  m_falsePositives += countOutside(touching, reference.touching);

  std::multimap<ElementPair, const Impact*> impacts;  // used by claims about triangles
  if (!first.empty() && first.begin()->first.kind == FeaturePair::Kind::Triangles)
    impacts = byTriangles(reference, a, b);
  for (const auto& [features, claim] : first) {
    if (features.kind == FeaturePair::Kind::Triangles) {
      // The claim does not name features: the impact with the smallest error counts.
      const auto [begin, end] = impacts.equal_range({features.ids[0], features.ids[1]});
      const auto nearest = std::min_element(begin, end, [&](const auto& l, const auto& r) {
        return l.second->normal.dot(claim.normal) > r.second->normal.dot(claim.normal);
      });
      if (nearest != end) addErrors(claim, *nearest->second);
    } else {
      const auto impact = reference.impacts.find(features);
      if (impact != reference.impacts.end() && impact->second) addErrors(claim, *impact->second);
    }
  }
}

}  // namespace palpate::accuracy
