#include "Diagnostics/Audit.h"

#include <palpate/Capture.h>

#include "CollisionDetection/DiagnosticsInterface.h"
#include "CollisionDetection/ExcludedImpacts.h"
#include "CollisionDetection/FirstImpacts.h"
#include "NarrowPhase/Continuous.h"
#include "NarrowPhase/Intersection.h"
#include "NarrowPhase/Order.h"
#include "NarrowPhase/Piercing.h"
#include "Shapes/DistinctContacts.h"

#include <algorithm>
#include <array>
#include <filesystem>
#include <functional>
#include <initializer_list>
#include <iterator>
#include <limits>
#include <map>
#include <random>
#include <string>
#include <system_error>
#include <tuple>
#include <type_traits>

namespace palpate {

namespace {

std::uint32_t low(std::uint64_t value) { return static_cast<std::uint32_t>(value); }
std::uint32_t high(std::uint64_t value) { return static_cast<std::uint32_t>(value >> 32); }

/// `count` of the numbers below `size`, ascending. (Bentley and Floyd, A sample of brilliance,
/// Communications of the ACM 30, 1987.)
std::vector<std::uint64_t> drawNumbers(std::uint64_t count, std::uint64_t size,
                                       std::mt19937_64& random) {
  std::vector<std::uint64_t> drawn;
  for (std::uint64_t last = size - count; last < size; ++last) {
    std::uint64_t number = random() % (last + 1);
    auto place = std::lower_bound(drawn.begin(), drawn.end(), number);
    if (place != drawn.end() && *place == number) {
      number = last;
      place = drawn.end();
    }
    drawn.insert(place, number);
  }
  return drawn;
}

/// The ids by which contacts are ordered and distinguished.
std::array<std::uint32_t, 2> idsOf(const VertexTriangleContact& c) {
  return {c.vertex, c.triangle};
}
std::array<std::uint32_t, 4> idsOf(const EdgeEdgeContact& c) {
  return {c.edgeA[0], c.edgeA[1], c.edgeB[0], c.edgeB[1]};
}
std::array<std::uint32_t, 2> idsOf(const ElementPair& pair) { return {pair.a, pair.b}; }
std::array<std::uint32_t, 3> idsOf(const ShapeContact& c) {
  return {static_cast<std::uint32_t>(c.element), c.id, c.vertices[1]};
}
int idsOf(const ShapeShapeContact&) { return 0; }  // there is one

/// Decides which contacts a sample of features covers. Brute force for the sample finds every
/// covered contact. Of Intersection all contacts are covered: they follow from the triangles that
/// the answer lists.
class Coverage {
 public:
  Coverage(const MeshPair& meshes, const FeatureLists& sample)
      : m_meshes(meshes),
        m_sample(sample),
        m_byTriangles(meshes.settings.method == Method::Intersection) {}

  bool coversVertexTriangle(const VertexTriangleContact& c) const {
    if (c.vertex >= m_meshes.a.topology.vertexCount) return true;  // there is no such vertex
    return m_byTriangles || holds(m_sample.verticesOfA, c.vertex);
  }
  bool coversTriangleVertex(const VertexTriangleContact& c) const {
    return m_byTriangles || holds(m_sample.verticesOfB, c.vertex);
  }
  bool coversEdges(const EdgeEdgeContact& c) const {
    const std::uint32_t edgeA = m_meshes.a.topology.edgeOf(c.edgeA),
                        edgeB = m_meshes.b.topology.edgeOf(c.edgeB);
    if (edgeA == kNoEdge || edgeB == kNoEdge) return true;  // there are no such edges
    return m_byTriangles || holds(m_sample.edgesOfA, edgeA);
  }
  /// Vertices and edges are covered by the element that owns them.
  bool coversShape(const ShapeContact& c) const {
    const MeshTopology& mesh = m_meshes.mesh().topology;
    if (c.element == ShapeElement::Face) return holds(m_sample.trianglesOfA, c.id);
    const bool isVertex = c.element == ShapeElement::Vertex;
    const std::uint32_t edge = isVertex ? 0 : mesh.edgeOf({c.vertices[0], c.vertices[1]});
    if (isVertex ? c.id >= mesh.vertexCount : edge == kNoEdge) return true;  // no such element
    const auto owners = isVertex ? mesh.vertexTriangles[c.id] : mesh.edgeTriangles[edge];
    return owners.empty() || holds(m_sample.trianglesOfA, owners.front());
  }
  bool coversTriangles(const ElementPair& pair) const {
    return holds(m_sample.trianglesOfA, m_meshes.self() ? std::min(pair.a, pair.b) : pair.a);
  }

 private:
  static bool holds(const std::vector<std::uint32_t>& list, std::uint32_t id) {
    return std::binary_search(list.begin(), list.end(), id);
  }

  const MeshPair& m_meshes;
  const FeatureLists& m_sample;
  bool m_byTriangles;
};

/// Intersection: adds the contacts of triangles that are listed in the answer and not in the
/// sample. pierced: receives the contacts that depend on all triangles that intersect.
void addListed(const MeshPair& meshes, const Coverage& coverage, const CollisionData& answer,
               ContactBuffers& contacts, ContactBuffers& pierced) {
  const std::size_t countA = meshes.a.topology.triangles.size(),
                    countB = meshes.b.topology.triangles.size();
  for (const ElementPair& pair : answer.intersectingTriangles())
    if (pair.a < countA && pair.b < countB && !coverage.coversTriangles(pair))
      addIntersection(meshes, pair, contacts);
  ContactBuffers* const found[] = {&contacts};
  PiercingContacts().find(meshes, found, pierced);
}

/// Auto, in a step that begins in intersection: whether a contact may be left out because the sides
/// of its vertices are known (KnownSides). These are vertices of triangles that intersect the other
/// mesh at the step's start or at its end. Tests the triangles around them with all others.
class KnownVertices {
 public:
  explicit KnownVertices(const MeshPair& meshes) : m_meshes(meshes) {}

  bool mayDrop(const VertexTriangleContact& c, bool swapped) const {
    return intersects(swapped, c.vertex) || anyIntersects(!swapped, c.corners);
  }
  bool mayDrop(const EdgeEdgeContact& c) const {
    return anyIntersects(false, c.edgeA) || anyIntersects(true, c.edgeB);
  }

 private:
  template <class Vertices>
  bool anyIntersects(bool ofB, const Vertices& vertices) const {
    return std::any_of(vertices.begin(), vertices.end(),
                       [&](std::uint32_t v) { return intersects(ofB, v); });
  }
  bool intersects(bool ofB, std::uint32_t vertex) const {
    const auto around = (ofB ? m_meshes.b : m_meshes.a).topology.vertexTriangles[vertex];
    const MeshTopology& others = (ofB ? m_meshes.a : m_meshes.b).topology;
    return std::any_of(around.begin(), around.end(), [&](std::uint32_t triangle) {
      for (std::uint32_t other = 0; other < others.triangles.size(); ++other)
        if (others.isEnabled(other) &&
            intersect(ofB ? ElementPair{other, triangle} : ElementPair{triangle, other}))
          return true;
      return false;
    });
  }
  bool intersect(ElementPair pair) const {
    if (m_meshes.self() && pair.b < pair.a) std::swap(pair.a, pair.b);
    if (m_meshes.self() && pair.a == pair.b) return false;
    SignCounts counts;
    return intersectionOf(m_meshes, true, pair, counts).intersect() ||
           intersectionOf(m_meshes, false, pair, counts).intersect();
  }

  const MeshPair& m_meshes;
};

/// Contacts::Distinct for impacts of lines and points: drops excluded impacts for which others
/// stand. Computes all impacts of their vertices and edges.
class ExcludedByBruteForce {
 public:
  explicit ExcludedByBruteForce(const MeshPair& meshes) : m_meshes(meshes), m_rule(meshes) {}

  bool isDropped(const VertexTriangleContact& c, bool swapped) {
    if (!m_rule.isExcluded(c, swapped)) return false;
    m_ofVertices.clear();
    addImpactsOf(c.vertex, swapped);
    return m_rule.isReplaced(c, swapped, [&](auto&& f) { return anyOfVertices(swapped, f); });
  }
  bool isDropped(const EdgeEdgeContact& c) {
    if (!m_rule.isExcluded(c)) return false;
    const bool swapped = m_rule.linesAreSecond();
    const Segment& edge = m_rule.lineEdge(c);
    m_ofVertices.clear();
    for (const std::uint32_t end : edge) addImpactsOf(end, swapped);
    findImpactsOf(edge);
    return m_rule.isReplaced(c, [&](auto&& f) {
      return std::any_of(
                 m_ofEdge.edgeEdge.begin(), m_ofEdge.edgeEdge.end(),
                 [&](const auto& s) { return !m_rule.isExcluded(s) && f(s, m_rule.planeOf(s)); }) ||
             anyOfVertices(swapped, f);
    });
  }

 private:
  template <class F>
  bool anyOfVertices(bool swapped, F&& f) const {
    const auto& impacts = swapped ? m_ofVertices.triangleVertex : m_ofVertices.vertexTriangle;
    return std::any_of(impacts.begin(), impacts.end(), [&](const auto& s) {
      return !m_rule.isExcluded(s, swapped) && f(s, m_rule.planeOf(s, swapped));
    });
  }
  void addImpactsOf(std::uint32_t vertex, bool swapped) {
    const Features<ImpactQuery::Kind::VertexTriangle> features{swapped ? m_meshes.b : m_meshes.a,
                                                               swapped ? m_meshes.a : m_meshes.b};
    const MeshTopology& others = (swapped ? m_meshes.a : m_meshes.b).topology;
    for (std::uint32_t t = 0; t < others.triangles.size(); ++t)
      if (others.isEnabled(t) && !m_meshes.excludesVertex(vertex, t))
        addImpact(m_meshes, features, vertex, t, swapped, m_ofVertices);
  }
  /// Of an edge of a line near a triangle mesh.
  void findImpactsOf(const Segment& edge) {
    const bool second = m_rule.linesAreSecond();
    const Features<ImpactQuery::Kind::EdgeEdge> features{m_meshes.a, m_meshes.b};
    const std::uint32_t line = (second ? m_meshes.b : m_meshes.a).topology.edgeOf(edge);
    const MeshTopology& others = (second ? m_meshes.a : m_meshes.b).topology;
    m_ofEdge.clear();
    for (std::uint32_t other = 0; other < others.edges.size(); ++other)
      if (!others.edgeTriangles[other].empty())
        addImpact(m_meshes, features, second ? other : line, second ? line : other, false,
                  m_ofEdge);
  }

  const MeshPair& m_meshes;
  const ExcludedImpacts m_rule;
  ContactBuffers m_ofVertices, m_ofEdge;
};

void dropExcludedImpacts(const MeshPair& meshes, CollisionData::Contents& expected) {
  const bool impactsOnly = meshes.settings.method == Method::Continuous;
  if (meshes.settings.contacts != Contacts::Distinct || !ExcludedImpacts(meshes).mayExclude() ||
      !(impactsOnly || meshes.step.reportsImpacts))
    return;
  ExcludedByBruteForce excluded(meshes);
  forEachImpactList(expected, [&](auto& contacts, int list) {
    std::erase_if(contacts, [&](const auto& contact) {
      if constexpr (std::is_same_v<decltype(contact), const EdgeEdgeContact&>)
        return excluded.isDropped(contact);
      else
        return excluded.isDropped(contact, list == 1);
    });
  });
}

/// Contacts::Distinct for impacts: drops expected contacts for which an earlier contact is kept.
/// The earlier contact is either expected, too, or in the answer if the sample does not cover it.
void dropRepeatedImpacts(const MeshPair& meshes, const CollisionData& answer,
                         CollisionData::Contents& expected) {
  const bool impactsOnly = meshes.settings.method == Method::Continuous;
  if (meshes.settings.contacts != Contacts::Distinct ||
      !(impactsOnly || meshes.step.reportsImpacts))
    return;
  const double end = impactsOnly ? std::numeric_limits<double>::infinity() : 1.0;
  using Rank = std::tuple<double, int, std::array<std::uint32_t, 4>>;
  const auto rankOf = [](const auto& contact, int list) -> Rank {
    if constexpr (std::is_same_v<decltype(contact), const EdgeEdgeContact&>)
      return {contact.timeOfImpact, list, idsOf(contact)};
    else if (list == 1)
      return {contact.timeOfImpact, list, {contact.triangle, contact.vertex, 0, 0}};
    else
      return {contact.timeOfImpact, list, {contact.vertex, contact.triangle, 0, 0}};
  };
  const auto featuresOf = [&](const auto& contact, int list) {
    if constexpr (std::is_same_v<decltype(contact), const EdgeEdgeContact&>)
      return sharedFeatures(contact, meshes.self());
    else
      return sharedFeatures(contact, list == 1, meshes.self());
  };
  std::map<ImpactFeatures, Rank> first;
  const auto recordFirst = [&](const auto& contacts, int list) {
    for (const auto& contact : contacts)
      if (const auto features = featuresOf(contact, list); features && contact.timeOfImpact < end) {
        const Rank rank = rankOf(contact, list);
        const auto [place, isNew] = first.emplace(*features, rank);
        if (!isNew) place->second = std::min(place->second, rank);
      }
  };
  recordFirst(answer.vertexTriangle(), 0);
  recordFirst(answer.triangleVertex(), 1);
  recordFirst(answer.edgeEdge(), 2);
  forEachImpactList(expected, recordFirst);
  const auto isDropped = [&](const auto& contact, int list) {
    const auto features = featuresOf(contact, list);
    const auto place = features ? first.find(*features) : first.end();
    return place != first.end() && contact.timeOfImpact < end &&
           place->second < rankOf(contact, list);
  };
  // Brute force may find a contact at the step's end that Auto reports by its impact. Auto may then
  // drop this impact.
  const auto isDroppedImpact = [&](const auto& contact, int list) {
    if (contact.timeOfImpact < end) return false;
    ContactBuffers impact;
    if constexpr (std::is_same_v<decltype(contact), const EdgeEdgeContact&>) {
      const Features<ImpactQuery::Kind::EdgeEdge> features{meshes.a, meshes.b};
      addImpact(meshes, features, meshes.a.topology.edgeOf(contact.edgeA),
                meshes.b.topology.edgeOf(contact.edgeB), false, impact);
    } else {
      const bool swapped = list == 1;
      const Features<ImpactQuery::Kind::VertexTriangle> features{swapped ? meshes.b : meshes.a,
                                                                 swapped ? meshes.a : meshes.b};
      addImpact(meshes, features, contact.vertex, contact.triangle, swapped, impact);
    }
    bool dropped = false;
    forEachImpactList(impact, [&](const auto& contacts, int of) {
      for (const auto& found : contacts) dropped |= isDropped(found, of);
    });
    return dropped;
  };
  forEachImpactList(expected, [&](auto& contacts, int list) {
    std::erase_if(contacts, [&](const auto& contact) {
      return isDropped(contact, list) || isDroppedImpact(contact, list);
    });
  });
}

/// Calls report(fault, expected, found) where two lists differ. A contact that was found but not
/// expected counts only if it is covered.
template <class Contact, class Covered, class Report>
void compare(CountedVector<Contact> expected, std::span<const Contact> allFound, Covered&& covered,
             Report&& report) {
  const auto before = [](const Contact& l, const Contact& r) { return idsOf(l) < idsOf(r); };
  CountedVector<Contact> found;
  std::stable_sort(expected.begin(), expected.end(), before);
  std::copy_if(allFound.begin(), allFound.end(), std::back_inserter(found), [&](const Contact& c) {
    return covered(c) || std::binary_search(expected.begin(), expected.end(), c, before);
  });
  std::stable_sort(found.begin(), found.end(), before);
  using Fault = AuditFailure::Fault;
  auto f = found.begin();
  for (const Contact& e : expected) {
    for (; f != found.end() && before(*f, e); ++f) report(Fault::FalsePositive, {}, *f);
    if (f == found.end() || before(e, *f)) {
      report(Fault::FalseNegative, e, {});
    } else {
      if (!(*f == e)) report(Fault::Different, e, *f);
      ++f;
    }
  }
  for (; f != found.end(); ++f) report(Fault::FalsePositive, {}, *f);
}

}  // namespace

FeatureLists drawFeatures(const MeshPair& meshes, const CollisionPair& pair,
                          const AuditSettings& settings, std::uint64_t frame) {
  FeatureLists features = everyFeature(meshes);
  const std::initializer_list<std::vector<std::uint32_t>*> lists{
      &features.verticesOfA, &features.verticesOfB, &features.edgesOfA, &features.trianglesOfA};
  std::uint64_t size = 0;
  for (const auto* list : lists) size += list->size();
  const auto count = static_cast<std::uint64_t>(settings.features);
  if (count >= size) return features;

  const auto a = static_cast<std::uint32_t>(pair.a), b = static_cast<std::uint32_t>(pair.b);
  std::seed_seq seed{low(settings.seed), high(settings.seed), low(frame), high(frame), a, b};
  std::mt19937_64 random(seed);
  const std::vector<std::uint64_t> drawn = drawNumbers(count, size, random);
  auto next = drawn.begin();
  std::uint64_t first = 0;
  for (auto* list : lists) {
    const std::uint64_t listSize = list->size();
    std::size_t kept = 0;
    for (; next != drawn.end() && *next < first + listSize; ++next)
      (*list)[kept++] = (*list)[*next - first];
    list->resize(kept);
    first += listSize;
  }
  return features;
}

void audit(const MeshPair& meshes, const CollisionPair& pair, const CollisionData& data,
           const AuditSettings& settings, std::uint64_t frame, bool sidesAreKnown,
           std::vector<AuditFailure>& out) {
  ContactBuffers contacts, pierced;
  const FeatureLists sample = drawFeatures(meshes, pair, settings, frame);
  const Coverage coverage(meshes, sample);
  // Any contact with a shape may stand for one of the sample.
  const bool needsAll =
      meshes.hasShape() && !meshes.isShapePair() && meshes.settings.contacts == Contacts::Distinct;
  findContactsByBruteForce(meshes, needsAll ? everyFeature(meshes) : sample, contacts);
  if (meshes.settings.method == Method::Intersection)
    addListed(meshes, coverage, data, contacts, pierced);
  ContactBuffers* const buffers[] = {&contacts, &pierced};
  OrderScratch scratch;
  CollisionData::Contents expected;
  orderContacts(buffers, 0, scratch, expected);

  using List = AuditFailure::List;
  using Fault = AuditFailure::Fault;
  using Any = AuditFailure::Contact;
  // Auto replaces some of its contacts by those of other methods. Brute force for a sample does not
  // reproduce this, so that only missing contacts are reported.
  const bool isAuto = pair.settings.method == Method::Auto;
  const KnownVertices known(meshes);
  const auto mayBeDropped = [&](const Any& e, List list) {
    if (const auto* c = std::get_if<VertexTriangleContact>(&e))
      return known.mayDrop(*c, list == List::TriangleVertex);
    const auto* c = std::get_if<EdgeEdgeContact>(&e);
    return c && known.mayDrop(*c);
  };
  const auto reporterFor = [&](List list) {
    return [=, &pair, &out](Fault fault, const Any& e, const Any& f) {
      if (isAuto && (fault != Fault::FalseNegative || (sidesAreKnown && mayBeDropped(e, list))))
        return;
      out.push_back({pair.a, pair.b, frame, fault, list, e, f, {}, {}});
    };
  };
  if (meshes.settings.earliestTimeOnly) {
    return forEachTimed(expected, [&](const auto& all) {
      for (const auto& contact : all)
        if (contact.timeOfImpact < data.earliestTimeOfImpact())
          reporterFor(List::Earliest)(Fault::FalseNegative, contact, {});
    });
  }
  dropExcludedImpacts(meshes, expected);
  dropRepeatedImpacts(meshes, data, expected);
  if (needsAll) {
    expected.shape.resize(DistinctContacts().keep(
        meshes.mesh(), meshes.shape().now, meshes.poses().before.transform(),
        meshes.poses().now.transform(), meshes.settings, expected.shape));
    std::erase_if(expected.shape, [&](const ShapeContact& c) { return !coverage.coversShape(c); });
  }
  const auto compareList = [&](const auto& truth, const auto& found, auto covers, List list) {
    compare(truth, found, std::bind_front(covers, &coverage), reporterFor(list));
  };
  compareList(expected.vertexTriangle, data.vertexTriangle(), &Coverage::coversVertexTriangle,
              List::VertexTriangle);
  compareList(expected.triangleVertex, data.triangleVertex(), &Coverage::coversTriangleVertex,
              List::TriangleVertex);
  compareList(expected.edgeEdge, data.edgeEdge(), &Coverage::coversEdges, List::EdgeEdge);
  compareList(expected.intersectingTriangles, data.intersectingTriangles(),
              &Coverage::coversTriangles, List::IntersectingTriangles);
  compareList(expected.shape, data.shape(), &Coverage::coversShape, List::Shape);
  compare(
      expected.shapeShape, data.shapeShape(), [](const auto&) { return true; },
      reporterFor(List::ShapeShape));
}

CollisionProblem reducedToPair(const CollisionProblem& whole, GeometryId idA, GeometryId idB) {
  CollisionProblem problem{whole.settings, {}, {}};
  for (CollisionProblem::Pair pair : whole.pairs) {
    const CollisionProblem::Geometry &a = whole.geometries[pair.a], &b = whole.geometries[pair.b];
    if (a.id != idA || b.id != idB) continue;
    problem.geometries.push_back(a);
    if (pair.a != pair.b) problem.geometries.push_back(b);
    pair.b = pair.a == pair.b ? 0 : 1;
    pair.a = 0;
    problem.pairs.push_back(pair);
  }
  return problem;
}

/// Writes the problem of one pair's failures to a new file in the settings' folder, and sets the
/// file's name in each failure.
static void keepProblem(const CollisionProblem& problem, const AuditSettings& settings,
                        std::span<AuditFailure> failures) {
  const AuditFailure& first = failures.front();
  const std::string name = "frame" + std::to_string(first.frame) + "-pair" +
                           std::to_string(static_cast<std::uint32_t>(first.a)) + "-" +
                           std::to_string(static_cast<std::uint32_t>(first.b));
  std::filesystem::path file = settings.folder / (name + ".capture");
  std::error_code fault;
  for (int copy = 2; std::filesystem::exists(file, fault); ++copy)
    file = settings.folder / (name + "-" + std::to_string(copy) + ".capture");
  std::string error;
  try {
    writeCapture(reducedToPair(problem, first.a, first.b), file);
  } catch (const Error& e) {
    error = e.what();
    file.clear();
  }
  for (AuditFailure& failure : failures) {
    failure.file = file;
    failure.fileError = error;
  }
}

void auditFrame(const Settings& settings, const GeometryTable& geometries, const PairTable& pairs,
                AuditRecord& record) {
  std::vector<AuditFailure>& failures = record.failures;
  failures.clear();
  ++record.frame;
  if (settings.audit.features == 0) return;
  for (const auto& pair : pairs.records()) {
    // Brute force over features does not reproduce proxies, whose contacts have an error, nor
    // what bodies tell about contacts.
    if (!pair->collides() || pair->byBodies || pair->plan.kind == PairKind::Proxy ||
        pair->plan.kind == PairKind::ParticlesByLeaves)
      continue;
    const std::size_t first = failures.size();
    audit(pair->meshes(), pair->pair, pair->data, settings.audit, record.frame, pair->sidesAreKnown,
          failures);
    const auto own = std::span(failures).subspan(first);
    if (own.empty() || settings.audit.folder.empty()) continue;
    if (record.files < settings.audit.maxFiles) {
      keepProblem(problemOf(settings, geometries, pairs), settings.audit, own);
      record.files += !own.front().file.empty();
    } else {
      for (AuditFailure& failure : own)
        failure.fileError = "audit.maxFiles files were already written into \"" +
                            settings.audit.folder.string() + "\"";
    }
  }
}

}  // namespace palpate
