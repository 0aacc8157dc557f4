#include "Diagnostics/Audit.h"

#include <palpate/Capture.h>

#include "CollisionDetection/DiagnosticsInterface.h"
#include "Search/PairResults.h"
#include "Diagnostics/DistinctImpacts.h"
#include "NarrowPhase/Intersection.h"
#include "Contact/Order.h"
#include "Contact/Piercing.h"
#include "Contact/ContactLists.h"
#include "Contact/DistinctShapeContacts.h"
#include "Core/Assert.h"

#include <algorithm>
#include <array>
#include <filesystem>
#include <functional>
#include <initializer_list>
#include <iterator>
#include <random>
#include <string>
#include <system_error>

namespace palpate {

namespace {

std::uint32_t low(std::uint64_t value) { return static_cast<std::uint32_t>(value); }
std::uint32_t high(std::uint64_t value) { return static_cast<std::uint32_t>(value >> 32); }

/// `count` of the numbers below `size`, ascending. (Bentley and Floyd, A sample of brilliance,
/// Communications of the ACM 30, 1987.)
std::vector<std::uint64_t> drawNumbers(std::uint64_t count, std::uint64_t size,
                                       std::mt19937_64& random) {
  PALPATE_ASSERT(count <= size);
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

/// Decides which contacts a sample of features covers. Brute force for the sample finds every
/// covered contact. Of Intersection all contacts are covered: they follow from the triangles that
/// the answer lists.
class Coverage {
 public:
  Coverage(const Question& question, const FeatureLists& sample)
      : m_question(question),
        m_sample(sample),
        m_byTriangles(question.plan.method == Method::Intersection) {
    PALPATE_ASSERT(std::is_sorted(sample.verticesOfA.begin(), sample.verticesOfA.end()));
    PALPATE_ASSERT(std::is_sorted(sample.verticesOfB.begin(), sample.verticesOfB.end()));
    PALPATE_ASSERT(std::is_sorted(sample.edgesOfA.begin(), sample.edgesOfA.end()));
    PALPATE_ASSERT(std::is_sorted(sample.trianglesOfA.begin(), sample.trianglesOfA.end()));
  }

  bool covers(ContactKind kind, const VertexTriangleContact& c) const {
    const bool ofSecond = kind == ContactKind::TriangleVertex;
    if (!ofSecond && c.vertex >= ofA().vertexCount) return true;  // there is no such vertex
    return m_byTriangles || holds(ofSecond ? m_sample.verticesOfB : m_sample.verticesOfA, c.vertex);
  }
  bool covers(ContactKind, const EdgeEdgeContact& c) const {
    const std::uint32_t edgeA = ofA().edgeOf(c.edgeA), edgeB = ofB().edgeOf(c.edgeB);
    if (edgeA == kNoEdge || edgeB == kNoEdge) return true;  // there are no such edges
    return m_byTriangles || holds(m_sample.edgesOfA, edgeA);
  }
  /// Vertices and edges are covered by the element that owns them.
  bool covers(ContactKind, const ShapeContact& c) const {
    const MeshTopology& mesh = m_question.mesh().mesh.topology;
    if (c.element == ShapeElement::Face) return holds(m_sample.trianglesOfA, c.id);
    const bool isVertex = c.element == ShapeElement::Vertex;
    const std::uint32_t edge = isVertex ? 0 : mesh.edgeOf({c.vertices[0], c.vertices[1]});
    if (isVertex ? c.id >= mesh.vertexCount : edge == kNoEdge) return true;  // no such element
    const auto owners = isVertex ? mesh.vertexTriangles[c.id] : mesh.edgeTriangles[edge];
    return owners.empty() || holds(m_sample.trianglesOfA, owners.front());
  }
  bool covers(ContactKind, const ShapeShapeContact&) const { return true; }
  bool covers(const ElementPair& pair) const {
    return holds(m_sample.trianglesOfA, m_question.self() ? std::min(pair.a, pair.b) : pair.a);
  }

 private:
  const MeshTopology& ofA() const { return m_question.a.mesh.topology; }
  const MeshTopology& ofB() const { return m_question.b.mesh.topology; }
  static bool holds(const std::vector<std::uint32_t>& list, std::uint32_t id) {
    return std::binary_search(list.begin(), list.end(), id);
  }

  const Question& m_question;
  const FeatureLists& m_sample;
  bool m_byTriangles;
};

/// Intersection: adds the contacts of triangles that are listed in the answer and not in the
/// sample. pierced: receives the contacts that depend on all triangles that intersect.
void addListed(const MeshPair& meshes, const Coverage& coverage, const CollisionData& answer,
               ContactBuffers& contacts, ContactBuffers& pierced) {
  const std::size_t countA = meshes.a.topology.elements.size(),
                    countB = meshes.b.topology.elements.size();
  for (const ElementPair& pair : answer.intersectingTriangles())
    if (pair.a < countA && pair.b < countB && !coverage.covers(pair))
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
    return intersects(swapped, c.vertex) || anyIntersects(!swapped, c.vertices);
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
      for (std::uint32_t other = 0; other < others.elements.size(); ++other)
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

/// Calls report(fault, expected, found) where two lists differ. A contact that was found but not
/// expected counts only if it is covered. idsOf(contact): by which contacts are distinguished.
template <class Contact, class IdsOf, class Covered, class Report>
void compare(CountedVector<Contact> expected, std::span<const Contact> allFound, IdsOf&& idsOf,
             Covered&& covered, Report&& report) {
  const auto before = [&](const Contact& l, const Contact& r) { return idsOf(l) < idsOf(r); };
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

/// compare() for all lists. reporterFor(list): reports faults of a list.
template <class ReporterFor>
void compareAll(const CollisionData::Contents& expected, const CollisionData& data,
                const Coverage& coverage, ReporterFor&& reporterFor) {
  using List = AuditFailure::List;
  constexpr std::array kListOf{List::VertexTriangle, List::TriangleVertex, List::EdgeEdge,
                               List::Shape, List::ShapeShape};
  const CollisionData::Contents& found = CollisionData::Contents::read(data);
  const auto compareList = [&](auto kind, const auto& truth) {
    compare(
        truth, std::span(contactList<kind()>(found)), [&](const auto& c) { return keyOf(kind, c); },
        [&](const auto& c) { return coverage.covers(kind, c); },
        reporterFor(kListOf[static_cast<std::size_t>(kind())]));
  };
  forEachMeshList(expected, compareList);
  compare(
      expected.intersectingTriangles, data.intersectingTriangles(), std::identity(),
      [&](const ElementPair& c) { return coverage.covers(c); },
      reporterFor(List::IntersectingTriangles));
  forEachShapeList(expected, compareList);
}

}  // namespace

FeatureLists drawFeatures(const Question& question, const AuditSettings& settings,
                          std::uint64_t frame) {
  FeatureLists features = everyFeature(question);
  const std::initializer_list<std::vector<std::uint32_t>*> lists{
      &features.verticesOfA, &features.verticesOfB, &features.edgesOfA, &features.trianglesOfA};
  std::uint64_t size = 0;
  for (const auto* list : lists) size += list->size();
  const auto count = static_cast<std::uint64_t>(settings.features);
  if (count >= size) return features;

  const auto a = static_cast<std::uint32_t>(question.pair.a),
             b = static_cast<std::uint32_t>(question.pair.b);
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

void audit(const Question& question, bool sidesAreKnown, const CollisionData& data,
           const AuditSettings& settings, std::uint64_t frame, std::vector<AuditFailure>& out) {
  ContactBuffers contacts, pierced;
  const MeshPair meshes = question.meshes();
  const CollisionPair& pair = question.pair;
  const FeatureLists sample = drawFeatures(question, settings, frame);
  const Coverage coverage(question, sample);
  // Any contact with a shape may stand for one of the sample.
  const bool needsAll = question.plan.kind == PairKind::MeshAndShape && meshes.reportsDistinct();
  findContactsByBruteForce(question, needsAll ? everyFeature(question) : sample, contacts);
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
  if (meshes.settings.continuous.earliestTimeOnly) {
    return forEachContactList(expected, [&](ContactKind, const auto& all) {
      for (const auto& contact : all)
        if (contact.timeOfImpact < data.earliestTimeOfImpact())
          reporterFor(List::Earliest)(Fault::FalseNegative, contact, {});
    });
  }
  dropExcludedImpacts(meshes, expected);
  dropRepeatedImpacts(meshes, data, expected);
  if (needsAll) {
    DistinctShapeContacts distinct;
    keepDistinct(question, distinct, expected.shape);
    std::erase_if(expected.shape,
                  [&](const ShapeContact& c) { return !coverage.covers(ContactKind::Shape, c); });
  }
  compareAll(expected, data, coverage, reporterFor);
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
  PALPATE_ASSERT(!failures.empty());
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
    const PairKind kind = pair->question->plan.kind;
    // Brute force over features does not reproduce proxies, whose contacts have an error, nor
    // what bodies tell about contacts.
    // The answer of an unfinished pair is of an earlier state.
    if (!pair->collides() || pair->memory.urgency.isUnfinished || pair->found.byBodies ||
        kind == PairKind::Proxy || kind == PairKind::AttachedProxy || pair->found.bySides)
      continue;
    const std::size_t first = failures.size();
    audit(*pair->question, pair->found.sidesAreKnown, pair->last.data, settings.audit, record.frame,
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
