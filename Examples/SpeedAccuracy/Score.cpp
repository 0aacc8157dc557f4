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

/// The features that touch, by the triangles that touch with them.
std::multimap<ElementPair, const Impact*> byTriangles(const Truth& truth, const Incidence& a,
                                                      const Incidence& b) {
  std::multimap<ElementPair, const Impact*> all;
  for (const auto& [features, impact] : truth.impacts) {
    if (!impact) continue;
    std::vector<ElementPair> triangles;
    Incidence::addTriangles(features, a, b, triangles);
    for (const ElementPair& pair : triangles) all.emplace(pair, &*impact);
  }
  return all;
}

/// The claim about features that touch, or the one that stands for it; null if there is none.
const Claim* claimOf(const FeaturePair& features, const std::optional<Impact>& impact,
                     const std::map<FeaturePair, Claim>& claims, const Substitutes& substitutes,
                     const Incidence& a, const Incidence& b) {
  const auto claim = claims.find(features);
  if (claim != claims.end()) return &claim->second;
  const Claim* substitute = substitutes.find(features, a, b);
  constexpr double kTimeError = 1e-12;  // of the truth and of rounding
  return substitute && impact && substitute->time > impact->time + kTimeError ? nullptr
                                                                              : substitute;
}

}  // namespace

void Score::addErrors(const Claim& claim, const Impact& impact) {
  distance.add(100 * std::abs(claim.distance - impact.gapAt(claim.time)) / meanEdge);
  normal.add(degreesBetween(claim.normal, impact.normal));
  time.add(100 * std::abs(claim.time - impact.time));
}

void Score::add(const Truth& truth, const Claims& said, const Incidence& a, const Incidence& b) {
  // Of several claims about the same features the first in time counts.
  std::map<FeaturePair, Claim> first;
  for (const Claim& claim : said.claims) {
    const auto [entry, isNew] = first.try_emplace(claim.features, claim);
    if (!isNew && claim.time < entry->second.time) entry->second = claim;
  }
  claims += first.size();
  const Substitutes substitutes(said);
  std::vector<ElementPair> touching = said.triangles;
  bool wrong = said.ofTriangles && said.triangles.empty() && !truth.touching.empty();
  for (const auto& [features, impact] : truth.impacts) {
    const Claim* claim = claimOf(features, impact, first, substitutes, a, b);
    // Of features that do touch in the step every triangle that holds them is found.
    if (claim) Incidence::addTriangles(features, a, b, touching);
    if (!said.ofTriangles) wrong |= !claim || (impact && claim->normal.dot(impact->normal) < 0);
  }
  if (said.trusted) {
    ++m_judged;
    silentFailures += wrong && *said.trusted;
    m_falseAlarms += !wrong && !*said.trusted;
  }
  for (const auto& [features, claim] : first)
    if (!claim.example) Incidence::addTriangles(features, a, b, touching);
  sortUnique(touching);
  m_touching += truth.touching.size();
  m_claimed += touching.size();
  m_missed += countOutside(truth.touching, touching);
  m_old += truth.touchingAtStart.size();
  m_oldMissed += countOutside(truth.touchingAtStart, touching);
  m_invented += countOutside(touching, truth.touching);

  std::multimap<ElementPair, const Impact*> impacts;  // for claims about triangles
  if (!first.empty() && first.begin()->first.kind == FeaturePair::Kind::Triangles)
    impacts = byTriangles(truth, a, b);
  for (const auto& [features, claim] : first) {
    if (features.kind == FeaturePair::Kind::Triangles) {
      // It does not say which features: the kindest of the pair's counts.
      const auto [begin, end] = impacts.equal_range({features.ids[0], features.ids[1]});
      const auto kindest = std::min_element(begin, end, [&](const auto& l, const auto& r) {
        return l.second->normal.dot(claim.normal) > r.second->normal.dot(claim.normal);
      });
      if (kindest != end) addErrors(claim, *kindest->second);
    } else {
      const auto impact = truth.impacts.find(features);
      if (impact != truth.impacts.end() && impact->second) addErrors(claim, *impact->second);
    }
  }
}

}  // namespace palpate::accuracy
