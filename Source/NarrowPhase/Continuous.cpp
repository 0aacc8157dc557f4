#include "NarrowPhase/Continuous.h"

#include "NarrowPhase/ElementBoxes.h"
#include "Contact/Filters.h"
#include "NarrowPhase/PassageFinder.h"
#include "NarrowPhase/Proximity.h"
#include "NarrowPhase/StepCheck.h"
#include "Contact/TouchNormal.h"
#include "Math/ClosestPoint.h"
#include "Math/ImpactFilter.h"
#include "Math/MotionBound.h"
#include "Math/Nearing.h"
#include "Math/Tolerances.h"
#include "Core/Assert.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <utility>

namespace palpate {

namespace {

using Eigen::Vector3d;
using Kind = ImpactQuery::Kind;

TimeOfImpactSettings settingsOf(const MeshPair& pair) {
  TimeOfImpactSettings settings;
  settings.minimumDistance =
      pair.settings.thickness + (pair.a.largestRadius + pair.b.largestRadius);
  settings.timeTolerance = pair.settings.continuous.timeTolerance;
  return settings;
}

/// Whether the boxes of both features over the step come within the distance. An impact may be
/// reported a little early (kApproachError), also where the features never come within the
/// distance. Such features are contacts only if their boxes do. The contacts then do not depend on
/// which boxes an octree compared.
bool boxesMeet(const ImpactQuery& query, double distance) {
  std::array<Eigen::AlignedBox3d, 2> boxes;
  for (int i = 0; i < 4; ++i) {
    const bool second = i >= (query.kind == Kind::VertexTriangle ? 1 : 2);
    for (const int end : {0, 1}) boxes[second].extend(query.vertices[i].at(end));
  }
  return overlap(boxes[0], boxes[1], distance);
}

/// Calls f(features, firstId, secondId, swapped) for the pairs that may have an impact, after a
/// test of eight pairs at a time. kSwapped: each of `pairs` lists a feature of features.second
/// first.
template <bool kSwapped, Kind kind, class F>
void filterPairs(const Features<kind>& features, std::span<const FeaturePair> pairs,
                 const TimeOfImpactSettings& settings, F&& f) {
  PALPATE_ASSERT(!kSwapped || kind == Kind::VertexTriangle);
  ImpactBlock block;
  const auto test = [&](const FeaturePair& pair, auto&& with) {
    return kSwapped ? with(pair.b, pair.a) : with(pair.a, pair.b);
  };
  for (std::size_t begin = 0; begin < pairs.size(); begin += ImpactBlock::kLanes) {
    const auto eight =
        pairs.subspan(begin, std::min<std::size_t>(ImpactBlock::kLanes, pairs.size() - begin));
    for (int lane = 0; lane < static_cast<int>(eight.size()); ++lane)
      test(eight[lane], [&](std::uint32_t firstId, std::uint32_t secondId) {
        const auto ids = features.vertices(firstId, secondId);
        for (int i = 0; i < 4; ++i) {
          const TriangleMesh& mesh = features.meshOf(i);
          block.set(lane, i, mesh.before[ids[i]], mesh.now[ids[i]]);
        }
      });
    unsigned lanes = mayImpact(kind, block, settings) & ((1u << eight.size()) - 1);
    for (; lanes != 0; lanes &= lanes - 1)
      test(eight[std::countr_zero(lanes)], [&](std::uint32_t firstId, std::uint32_t secondId) {
        f(features, firstId, secondId, kSwapped);
      });
  }
}

/// Calls f likewise for the feature pairs that the candidates own. swapped: features.first is
/// MeshPair::b.
template <class F>
void forEachLikelyPair(const MeshPair& pair, std::span<const ElementPair> candidates,
                       ContactBuffers& out, F&& f) {
  FeaturePairs& pairs = out.features;
  findFeaturePairs(pair.a.topology, pair.b.topology, pair.floats, candidates, pairs);
  // An early exit: f rejects these pairs as well. It is not taken where validity needs the facts of
  // all feature pairs.
  if (pair.nearAtRest && !pair.keepsApart && pair.step.motion == 0.0)
    std::erase_if(pairs.edgeEdge, [&](const FeaturePair& edges) {
      return areNearAtRest(pair, pair.a.topology.edges[edges.a], pair.b.topology.edges[edges.b]);
    });
  out.featurePairs += pairs.owned;
  const TimeOfImpactSettings settings = settingsOf(pair);
  filterPairs<false>(Features<Kind::VertexTriangle>{pair.a, pair.b}, pairs.vertexTriangle, settings,
                     f);
  filterPairs<true>(Features<Kind::VertexTriangle>{pair.b, pair.a}, pairs.triangleVertex, settings,
                    f);
  filterPairs<false>(Features<Kind::EdgeEdge>{pair.a, pair.b}, pairs.edgeEdge, settings, f);
}

bool isWithinStep(double time) { return time > 0.0 && time < 1.0; }

/// The weights of the closest point that decide which star touches (kTouchWeight).
Vector3d touchWeights(Vector3d weights, double time) {
  if (isWithinStep(time))
    for (double& weight : weights)
      if (weight < kTouchWeight) weight = 0.0;
  return weights;
}
double touchWeight(double weight, double time) {
  if (!isWithinStep(time)) return weight;
  return weight < kTouchWeight ? 0.0 : weight > 1.0 - kTouchWeight ? 1.0 : weight;
}

/// Tests feature pairs for impacts and appends their contacts.
class ContactFinder {
 public:
  ContactFinder(const MeshPair& pair, ContactBuffers& out)
      : m_pair(pair),
        m_check(pair, out),
        m_out(out),
        m_settings(settingsOf(pair)),
        m_passages(pair, m_settings.timeTolerance, out) {}

  /// Returns whether the pair is a contact that passes all filters.
  template <Kind kind>
  bool operator()(const Features<kind>& features, std::uint32_t firstId, std::uint32_t secondId,
                  bool swapped) {
    PALPATE_ASSERT(!m_pair.self() || kind == Kind::VertexTriangle ||
                   m_pair.a.topology.precedes(firstId, secondId));
    const ImpactQuery query = features.query(firstId, secondId);
    const ImpactResult answer =
        m_pair.keepsApart ? findNearing(query, radiiOf(m_pair, features, firstId, secondId),
                                        m_settings.timeTolerance)
                          : findImpact(query, m_settings);
    m_out.exactDecisions += answer.exact;
    if (m_pair.findsPassages() && answer.impact) m_passages.add<kind>(firstId, secondId, swapped);
    return answer.impact && boxesMeet(query, m_settings.minimumDistance) &&
           add(features, firstId, secondId, swapped, query, answer.time, true);
  }

  /// Call after the last pair.
  void finish() { m_passages.finish(); }

  /// Makes the contact of an impact and returns whether it passes all filters. store: the impact is
  /// recorded in the facts, and the contact is appended if it passes.
  template <Kind kind>
  bool add(const Features<kind>& features, std::uint32_t firstId, std::uint32_t secondId,
           bool swapped, const ImpactQuery& query, double time, bool store) {
    PALPATE_ASSERT(time >= 0.0 && time <= 1.0);
    const std::array<Vector3d, 4> p = positionsAt(query, time);
    std::array<MeshFeature, 2> closestFeatures, touching;
    const auto complete = [&](auto& contact) {
      const bool touch = m_settings.minimumDistance == 0.0 || contact.distance == 0.0;
      contact.timeOfImpact = time;
      contact.distance -= m_pair.a.largestRadius + m_pair.b.largestRadius;
      if (!touch) return;
      const TouchNormal normal = touchNormal(features, firstId, secondId, touching, time,
                                             contact.normal, m_out.exactDecisions);
      contact.normal = normal.direction;
      PALPATE_ASSERT(!contact.normal.isZero(0.0));
      m_out.facts.sideUnknown |= !normal.isSideKnown;
    };
    if (m_pair.settings.continuous.earliestTimeOnly) m_out.facts.clearance = 0.0;
    const auto isSuppressed = [&](const auto& closest, const Vector3d& direction, bool rejected) {
      if (store) m_check.recordImpact(features, firstId, secondId, time, closest.distance);
      return rejected || ((m_pair.a.outerSideOnly || m_pair.b.outerSideOnly) &&
                          pointsInward(m_pair, closestFeatures, direction, time));
    };
    if constexpr (kind == Kind::VertexTriangle) {
      const MeshTopology& topology = features.second.topology;
      const auto closest = closestAt(finiteVertexTriangleDistance, query, time, p);
      VertexTriangleContact contact =
          contactOf(firstId, secondId, topology.elements[secondId], closest);
      closestFeatures[swapped] = {MeshFeature::Kind::Vertex, firstId};
      closestFeatures[!swapped] = featureOf(topology, secondId, closest.feature);
      touching = {MeshFeature{MeshFeature::Kind::Vertex, firstId},
                  featureOf(topology, secondId,
                            spannedFeature(contact.vertices, touchWeights(contact.weights, time)))};
      complete(contact);
      const Vector3d direction = swapped ? -contact.normal : contact.normal;
      if (isSuppressed(closest, direction, rejectsVertex(m_pair, firstId, secondId, swapped)))
        return false;
      if (!store) return true;
      m_out.ofVertex(m_pair, swapped).push_back(contact);
      m_out.facts.recordTriangle(m_pair, secondId, !swapped, p[1], p[2], p[3]);
    } else {
      const MeshTopology &firstTopology = features.first.topology,
                         &secondTopology = features.second.topology;
      const auto closest = closestAt(finiteEdgeEdgeDistance, query, time, p);
      EdgeEdgeContact contact =
          contactOf(firstTopology.edges[firstId], secondTopology.edges[secondId], closest);
      closestFeatures = {featureOf(firstTopology, firstId, closest.featureA),
                         featureOf(secondTopology, secondId, closest.featureB)};
      touching = {
          featureOf(firstTopology, firstId, spannedFeature(touchWeight(contact.weightA, time))),
          featureOf(secondTopology, secondId, spannedFeature(touchWeight(contact.weightB, time)))};
      complete(contact);
      if (isSuppressed(closest, contact.normal, rejectsEdges(m_pair, firstId, secondId)))
        return false;
      if (!store) return true;
      m_out.edgeEdge.push_back(contact);
      m_out.facts.recordEdges(m_pair, contact.edgeA, contact.edgeB);
    }
    return true;
  }

 private:
  /// The radii with which features keep apart. Features that are near at rest have none, because
  /// the surfaces of a thread overlap there.
  template <Kind kind>
  static FeatureRadii radiiOf(const MeshPair& pair, const Features<kind>& features,
                              std::uint32_t firstId, std::uint32_t secondId) {
    const auto ids = features.vertices(firstId, secondId);
    constexpr std::size_t kSecond = kind == Kind::VertexTriangle ? 1 : 2;
    if (areNearAtRest(pair, std::span(ids).template first<kSecond>(),
                      std::span(ids).template last<4 - kSecond>()))
      return {};
    FeatureRadii radii;
    for (int i = 0; i < 4; ++i) radii[i] = features.meshOf(i).radius(ids[i]);
    return radii;
  }

  /// The closest points at an impact. p: positionsAt(). Features that touch when the step begins
  /// may be apart there by rounding; they are measured where they are.
  template <class Closest>
  Closest closestAt(Closest measure(const Vector3d&, const Vector3d&, const Vector3d&,
                                    const Vector3d&),
                    const ImpactQuery& query, double time, const std::array<Vector3d, 4>& p) {
    Closest closest = measure(p[0], p[1], p[2], p[3]);
    m_out.exactDecisions += closest.exact;
    double extent = 0.0;
    for (int i = 1; i < 4; ++i) extent = std::max(extent, (p[i] - p[0]).cwiseAbs().maxCoeff());
    if (time > 0.0 || closest.distance > kCertainDirection * extent) return closest;
    const auto& v = query.vertices;
    return measure(v[0].before, v[1].before, v[2].before, v[3].before);
  }

  const MeshPair& m_pair;
  StepCheck m_check;
  ContactBuffers& m_out;
  const TimeOfImpactSettings m_settings;
  PassageFinder m_passages;
};

/// Does the same, but only for pairs for which proximity at the step's end does not suffice.
class FastImpactFinder {
 public:
  FastImpactFinder(const MeshPair& pair, ContactBuffers& out)
      : m_check(pair, out), m_find(pair, out) {}

  template <Kind kind>
  void operator()(const Features<kind>& features, std::uint32_t firstId, std::uint32_t secondId,
                  bool swapped) {
    if (!m_check.proximitySuffices(features, firstId, secondId))
      m_find(features, firstId, secondId, swapped);
  }
  void finish() { m_find.finish(); }

 private:
  StepCheck m_check;
  ContactFinder m_find;
};

}  // namespace

void findContinuous(const MeshPair& pair, std::span<const ElementPair> candidates,
                    ContactBuffers& out) {
  ContactFinder finder(pair, out);
  forEachLikelyPair(pair, candidates, out, finder);
  finder.finish();
}

template <Kind kind>
bool addImpact(const MeshPair& pair, const Features<kind>& features, std::uint32_t firstId,
               std::uint32_t secondId, bool swapped, ContactBuffers& out) {
  ContactFinder finder(pair, out);
  const bool isContact = finder(features, firstId, secondId, swapped);
  finder.finish();
  return isContact;
}
template bool addImpact(const MeshPair&, const Features<Kind::VertexTriangle>&, std::uint32_t,
                        std::uint32_t, bool, ContactBuffers&);
template bool addImpact(const MeshPair&, const Features<Kind::EdgeEdge>&, std::uint32_t,
                        std::uint32_t, bool, ContactBuffers&);

bool addImpactOf(const MeshPair& pair, ContactKind kind, const VertexTriangleContact& c,
                 ContactBuffers& out) {
  const bool swapped = kind == ContactKind::TriangleVertex;
  const Features<Kind::VertexTriangle> features{pair.meshOf(swapped), pair.meshOf(!swapped)};
  return addImpact(pair, features, c.vertex, c.triangle, swapped, out);
}
bool addImpactOf(const MeshPair& pair, ContactKind, const EdgeEdgeContact& c, ContactBuffers& out) {
  const Features<Kind::EdgeEdge> features{pair.a, pair.b};
  return addImpact(pair, features, pair.a.topology.edgeOf(c.edgeA), pair.b.topology.edgeOf(c.edgeB),
                   false, out);
}

void findFastImpacts(const MeshPair& pair, std::span<const ElementPair> candidates,
                     ContactBuffers& out) {
  FastImpactFinder finder(pair, out);
  forEachLikelyPair(pair, candidates, out, finder);
  finder.finish();
}

/// Boxes over a part of the step cost more than boxes over the whole step. Only if the part is
/// shorter than this do they discard enough feature pairs.
constexpr double kShortPart = 1.0 / 32;

double findEarliestImpact(const MeshPair& pair, std::span<const ElementPair> candidates,
                          double upTo, ContactBuffers& counts) {
  const TimeOfImpactSettings settings = settingsOf(pair);
  double earliest = upTo;
  // A reported time may be early by the tolerance. A pair whose impact is after this end therefore
  // cannot report a time before `earliest`.
  const auto end = [&] { return std::min(earliest + settings.timeTolerance, 1.0); };
  ContactFinder finder(pair, counts);
  const auto test = [&](const auto& features, std::uint32_t firstId, std::uint32_t secondId,
                        bool swapped) {
    const ImpactQuery query = features.query(firstId, secondId);
    const ImpactResult answer = findImpact(query, settings, end());
    counts.exactDecisions += answer.exact;
    if (answer.impact && answer.time < earliest && boxesMeet(query, settings.minimumDistance) &&
        (!pair.hasFilters() ||
         finder.add(features, firstId, secondId, swapped, query, answer.time, false)))
      earliest = answer.time;
  };
  PALPATE_ASSERT(earliest >= 0.0);
  if (earliest <= 0.0) return earliest;
  MeshPair boxed = pair;
  FloatPair floats;
  if (pair.floats && end() < kShortPart) {
    floats = *pair.floats;
    floats.upTo = std::nextafter(static_cast<float>(end()), 1.0f);
    boxed.floats = &floats;
  }
  forEachLikelyPair(boxed, candidates, counts, test);
  return earliest;
}

}  // namespace palpate
