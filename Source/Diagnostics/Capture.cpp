#include <palpate/Capture.h>

#include "Diagnostics/Audit.h"
#include "CollisionDetection/GeometryTable.h"
#include "CollisionDetection/SettingsCheck.h"
#include "Shapes/Shape.h"
#include "Core/FloatingPoint.h"
#include "Core/WholeFile.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <fstream>
#include <iterator>
#include <locale>
#include <sstream>
#include <string>
#include <string_view>
#include <system_error>
#include <type_traits>
#include <utility>
#include <version>

namespace palpate {

namespace {

constexpr std::string_view kTitle = "palpate-capture";
constexpr int kVersion = 14;

// Enumerators are written by name. The names are in the order of the declarations.
constexpr std::array<std::string_view, 6> kMethods{"Auto",       "Intersection",  "Proximity",
                                                   "Continuous", "DistanceField", "Proxy"};
constexpr std::array<std::string_view, 5> kGeometryTypes{"Triangles", "Lines", "Points", "Shape",
                                                         "Field"};
constexpr std::array<std::string_view, 2> kSides{"Both", "Outer"};
constexpr std::array<std::string_view, 6> kShapes{"Sphere", "Capsule",  "Plane",
                                                  "Box",    "Cylinder", "ConvexHull"};
constexpr std::array<std::string_view, 3> kPassages{"VertexTriangle", "TriangleVertex", "EdgeEdge"};
constexpr std::array<std::string_view, 2> kContacts{"Distinct", "All"};
// Before version 9, a third value of `contacts` stood for earliestTimeOnly.
enum class ContactsBefore9 { Distinct, All, Earliest };
constexpr std::array<std::string_view, 3> kContactsBefore9{"Distinct", "All", "Earliest"};
constexpr std::array<std::string_view, 2> kEngines{"Octree", "BruteForce"};
constexpr std::array<std::string_view, 2> kUpdates{"Auto", "Rebuild"};
constexpr std::array<std::string_view, 3> kBounds{"Box", "Dop14", "Dop18"};

/// For messages: long words are cut.
std::string quoted(std::string_view text) {
  constexpr std::size_t kMost = 40;
  return std::string("\"")
      .append(text.substr(0, kMost))
      .append(text.size() > kMost ? "...\"" : "\"");
}

/// Writes a text of words. Line breaks are for human readers only.
class Writer {
 public:
  void word(std::string_view text) { (m_text += text) += ' '; }
  template <class Enumerator, std::size_t size>
  void word(Enumerator value, const std::array<std::string_view, size>& names) {
    word(names.at(static_cast<std::size_t>(value)));
  }
  template <class Integer>
  void integer(Integer value) {
    word(std::to_string(value));
  }
  /// Hexadecimal: exact, and the same in every locale.
  void real(double value) {
    char text[32];
    const auto end = std::to_chars(text, text + sizeof text, value, std::chars_format::hex).ptr;
    word({text, static_cast<std::size_t>(end - text)});
  }
  void expect(std::string_view text) { word(text); }
  void count(std::size_t value, std::size_t = 0) { integer(value); }
  void endLine() { m_text.back() = '\n'; }
  const std::string& text() const { return m_text; }

 private:
  std::string m_text;
};

/// Whether the whole text is a number in hexadecimal digits, without a prefix.
bool isHexadecimal(std::string_view text, double& value) {
#ifdef __cpp_lib_to_chars
  const auto [end, fault] =
      std::from_chars(text.begin(), text.end(), value, std::chars_format::hex);
  return end == text.end() && fault == std::errc();
#else  // libc++ 14 has from_chars() for integers only
  std::string prefixed(text);
  const std::size_t start = text.starts_with('-') ? 1 : 0;
  if (const std::string_view digits = "0123456789abcdefABCDEF.";
      start < text.size() && digits.find(text[start]) != digits.npos)
    prefixed.insert(start, "0x");
  std::istringstream stream(prefixed);
  stream.imbue(std::locale::classic());
  return stream >> value && stream.peek() == std::istringstream::traits_type::eof();
#endif
}

/// Reads such a text. Throws Error (ErrorCode::File) that names the file and the line.
class Reader {
 public:
  Reader(const std::filesystem::path& path, std::string text)
      : m_name("the capture \"" + path.string() + "\""), m_text(std::move(text)), m_rest(m_text) {}

  std::string_view word() {
    constexpr std::string_view kSpaces = " \t\r\n";
    const std::size_t begin = std::min(m_rest.find_first_not_of(kSpaces), m_rest.size());
    m_line += std::count(m_rest.begin(), m_rest.begin() + static_cast<std::ptrdiff_t>(begin), '\n');
    m_rest.remove_prefix(begin);
    if (m_rest.empty()) fail("the file is truncated");
    const std::size_t size = std::min(m_rest.find_first_of(kSpaces), m_rest.size());
    const std::string_view found = m_rest.substr(0, size);
    m_rest.remove_prefix(size);
    return found;
  }
  void expect(std::string_view text) {
    if (const std::string_view found = word(); found != text)
      fail("found " + quoted(found) + ", expected " + quoted(text));
  }
  template <class Enumerator, std::size_t size>
  void word(Enumerator& value, const std::array<std::string_view, size>& names) {
    const std::string_view found = word();
    const auto place = std::find(names.begin(), names.end(), found);
    if (place == names.end()) fail(quoted(found) + " is not a known name");
    value = static_cast<Enumerator>(place - names.begin());
  }
  template <class Integer>
  void integer(Integer& value) {
    const std::string_view found = word();
    if (const auto [end, fault] = std::from_chars(found.begin(), found.end(), value);
        end != found.end() || fault != std::errc())
      fail(quoted(found) + " is not an integer in range");
  }
  void real(double& value) {
    const std::string_view found = word();
    if (!isHexadecimal(found, value)) fail(quoted(found) + " is not a number");
  }
  /// Reads the number of items that follow. Refuses more than the rest of the file can hold if each
  /// takes at least so many characters, the space after it included.
  void count(std::size_t& value, std::size_t least) {
    integer(value);
    if (value > (m_rest.size() + 1) / least)
      fail("the file is truncated: too few lines for " + std::to_string(value));
  }
  void endLine() {}
  void expectEnd() {
    if (m_rest.find_first_not_of(" \t\r\n") != m_rest.npos) fail("there is text after the end");
  }
  std::string_view rest() const { return m_rest; }
  [[noreturn]] void fail(const std::string& reason) const {
    throw Error(ErrorCode::File, m_name + ", line " + std::to_string(m_line) + ": " + reason);
  }
  [[noreturn]] void failWhole(const std::string& reason) const {
    throw Error(ErrorCode::File, m_name + ": " + reason);
  }

 private:
  std::string m_name, m_text;
  std::string_view m_rest;
  std::ptrdiff_t m_line = 1;
};

// Functions that write or read parts of a file: `file` is a Writer or a Reader.

template <class File>
constexpr bool kReads = std::is_same_v<File, Reader>;

template <class File, class SettingsType>
void settingsLine(File& file, SettingsType& settings, int version) {
  file.word(settings.engine, kEngines);
  file.integer(settings.threads);
  file.integer(settings.octree.maxDepth);
  file.integer(settings.octree.maxElementsPerLeaf);
  file.word(settings.octree.update, kUpdates);
  if (version >= 10) file.word(settings.octree.bounds, kBounds);
}

template <class File>
void fieldOf(File& file, auto& value) {
  using Value = std::decay_t<decltype(value)>;
  if constexpr (std::is_same_v<Value, double>) {
    file.real(value);
  } else if constexpr (std::is_same_v<Value, bool>) {
    int number = value;
    file.integer(number);
    if constexpr (kReads<File>) value = number != 0;
  } else if constexpr (std::is_integral_v<Value>) {
    file.integer(value);
  } else {
    for (auto& part : value) fieldOf(file, part);
  }
}

// Least numbers of characters of items: a digit and a space for each number.
constexpr std::size_t kNumberText = 2, kPointText = 3 * kNumberText, kVertexText = 2 * kPointText,
                      kTriangleText = 3 * kNumberText, kTetrahedronText = 4 * kNumberText,
                      kGeometryText = std::string_view("geometry 0 0 0 ").size(),
                      kPairText = std::string_view("pair 0 0 Auto Auto 0 All ").size(),
                      kSideText = std::string_view("EdgeEdge 0 0 0 0 0 ").size();

/// The size of a list. A Reader resizes the list to it. least: characters of an item.
template <class File>
void sizeOf(File& file, auto& list, std::size_t least) {
  std::size_t size = list.size();
  file.count(size, least);
  if constexpr (kReads<File>) list.resize(size);
}

template <class File>
void listOf(File& file, auto& list) {
  sizeOf(file, list, kNumberText);
  fieldOf(file, list);
}

template <class File, class SettingsType>
void contactsOf(File& file, SettingsType& settings, int version) {
  if (version >= 9) return file.word(settings.contacts, kContacts);
  if constexpr (kReads<File>) {
    ContactsBefore9 contacts{};
    file.word(contacts, kContactsBefore9);
    settings.continuous.earliestTimeOnly = contacts == ContactsBefore9::Earliest;
    settings.contacts = contacts == ContactsBefore9::All ? Contacts::All : PairSettings().contacts;
  }
}

template <class File, class PairType>
void pairLine(File& file, PairType& pair, int version) {
  file.integer(pair.a);
  file.integer(pair.b);
  file.word(pair.settings.method, kMethods);
  file.word(pair.method, kMethods);
  file.real(pair.settings.thickness);
  contactsOf(file, pair.settings, version);
  if (version >= 2) file.real(pair.settings.automatic.motionTolerance);
  if (version >= 3) file.real(pair.settings.restDistance);
  if (version >= 4) fieldOf(file, pair.predicate);
  if (version >= 6) file.real(pair.settings.continuous.timeTolerance);
  if (version >= 9) fieldOf(file, pair.settings.continuous.earliestTimeOnly);
  if (version >= 11) file.real(pair.settings.allowedError);
  if (version >= 11) file.real(pair.settings.proxy.widestNormalCone);
  if (version >= 12) file.real(pair.settings.freeMotionReach);
  if (version >= 13) fieldOf(file, pair.settings.trackContacts);
  if (version >= 13) fieldOf(file, pair.settings.reportCrossings);
  if (version < 14) return;
  file.integer(pair.settings.priority);
  fieldOf(file, pair.settings.smoothNormals);
  fieldOf(file, pair.settings.rememberSides);
  sizeOf(file, pair.sides, kSideText);
  for (auto& side : pair.sides) {
    file.word(side.kind, kPassages);
    fieldOf(file, side.ids);
    fieldOf(file, side.forward);
  }
}

template <class File, class FilterType>
void filterOf(File& file, FilterType& filter) {
  file.integer(filter.groups);
  file.integer(filter.mask);
  file.word(filter.sidedness, kSides);
}

/// A shape's dimensions, and its placements at both ends of the step.
template <class File, class MeshType>
void shapeOf(File& file, MeshType& mesh, int version) {
  forEachField(*mesh.analytical, [&](std::string_view, auto& field) {
    if constexpr (requires { field.capacity(); }) sizeOf(file, field, kPointText);
    fieldOf(file, field);
  });
  const auto poseOf = [&](auto& pose) {
    for (int k = 0; k < 3; ++k) {
      for (int i = 0; i < 3; ++i) fieldOf(file, pose.rotation(k, i));
      fieldOf(file, pose.translation[k]);
    }
  };
  poseOf(mesh.motion.now);
  if (version >= 7) return poseOf(mesh.motion.before);
  if constexpr (kReads<File>) mesh.motion.before = mesh.motion.now;
}

/// A shape of the type with this index.
template <std::size_t... indices>
AnalyticalGeometry shapeOfType(std::size_t index, std::index_sequence<indices...>) {
  AnalyticalGeometry shape;
  (void)((index == indices && (shape.emplace<indices>(), true)) || ...);
  return shape;
}

template <class File, class MeshType>
void meshLines(File& file, MeshType& mesh, int version) {
  file.expect("geometry");
  auto id = static_cast<std::uint32_t>(mesh.id);
  file.integer(id);
  sizeOf(file, mesh.now, kVertexText);
  sizeOf(file, mesh.triangles, kTriangleText);
  if (version >= 3) {
    file.word(mesh.type, kGeometryTypes);
    listOf(file, mesh.radii);
    if (mesh.type == GeometryType::Shape) {
      std::size_t index = mesh.analytical ? mesh.analytical->index() : 0;
      file.word(index, kShapes);
      if constexpr (kReads<File>)
        mesh.analytical = shapeOfType(index, std::make_index_sequence<kShapes.size()>());
      shapeOf(file, mesh, version);
    }
  }
  std::size_t rest = kReads<File> ? mesh.type == GeometryType::Lines : mesh.rest.size();
  if (version >= 4) {
    filterOf(file, mesh.filter);
    listOf(file, mesh.disabled);
    file.count(rest, kNumberText);
  }
  if (version >= 8) sizeOf(file, mesh.tetrahedra, kTetrahedronText);
  if (version >= 14)
    for (auto* list : {&mesh.tags, &mesh.removed, &mesh.removedTetrahedra}) listOf(file, *list);
  file.endLine();
  if constexpr (kReads<File>) {
    mesh.id = GeometryId{id};
    mesh.before.resize(mesh.now.size());
    mesh.rest.resize(rest ? mesh.now.size() : 0);
  }
  for (std::size_t v = 0; v < mesh.now.size(); ++v) {
    fieldOf(file, mesh.before.at(v));
    fieldOf(file, mesh.now[v]);
    if (rest) fieldOf(file, mesh.rest.at(v));
    file.endLine();
  }
  const auto elements = [&](auto& list) {
    for (auto& element : list) {
      fieldOf(file, element);
      file.endLine();
    }
  };
  elements(mesh.triangles);
  elements(mesh.tetrahedra);
}

/// All lines except the title.
template <class File, class ProblemType>
void problemLines(File& file, ProblemType& problem, int version) {
  settingsLine(file, problem.settings, version);
  file.endLine();
  sizeOf(file, problem.geometries, kGeometryText);
  sizeOf(file, problem.pairs, kPairText);
  file.endLine();
  for (auto& mesh : problem.geometries) meshLines(file, mesh, version);
  for (auto& pair : problem.pairs) {
    file.expect("pair");
    pairLine(file, pair, version);
    file.endLine();
  }
  file.expect("end");
  file.endLine();
}

std::string textOf(const CollisionProblem& problem) {
  Writer file;
  file.word(kTitle);
  file.integer(kVersion);
  file.endLine();
  problemLines(file, problem, kVersion);
  return file.text();
}

GeometryId add(OctreeBasedCD& detection, const CollisionProblem::Geometry& mesh) {
  if (mesh.type == GeometryType::Field) return detection.addDistanceField(mesh.field);
  if (mesh.analytical) return detection.addAnalyticalGeometry(*mesh.analytical);
  const std::vector<Eigen::Vector3d>& rest = mesh.rest.empty() ? mesh.now : mesh.rest;
  if (mesh.type == GeometryType::Triangles &&
      !(mesh.removed.empty() && mesh.removedTetrahedra.empty()))
    return CutMesh{rest, mesh.triangles, mesh.removed, mesh.tetrahedra, mesh.removedTetrahedra}
        .addTo(detection);
  if (!mesh.tetrahedra.empty()) return detection.addTetrahedralMesh(rest, mesh.tetrahedra);
  if (mesh.type == GeometryType::Triangles) return detection.addTriangleMesh(rest, mesh.triangles);
  const bool one = mesh.radii.size() <= 1;
  const double radius = one && !mesh.radii.empty() ? mesh.radii.front() : 0.0;
  if (mesh.type == GeometryType::Points)
    return one ? detection.addPointSet(mesh.now, radius)
               : detection.addPointSet(mesh.now, mesh.radii);
  std::vector<Segment> segments;
  for (const auto& [p, q, _] : mesh.triangles) segments.push_back({p, q});
  return one ? detection.addLineMesh(rest, segments, radius)
             : detection.addLineMesh(rest, segments, mesh.radii);
}

void fill(OctreeBasedCD& detection, const CollisionProblem& problem) {
  for (const CollisionProblem::Geometry& mesh : problem.geometries) {
    const GeometryId id = add(detection, mesh);
    const bool isField = mesh.type == GeometryType::Field;
    if (!mesh.analytical && !isField) detection.setPositions(id, mesh.before, mesh.now);
    if (mesh.analytical || mesh.field || mesh.proxy)
      detection.setTransform(id, mesh.motion.before, mesh.motion.now);
    detection.setName(id, mesh.name);
    detection.setCollisionFilter(id, mesh.filter);
    detection.setDisabledElements(id, mesh.disabled);
    detection.setTags(id, mesh.tags);
    if (mesh.field && !isField) detection.attachDistanceField(id, mesh.field);
    if (mesh.proxy) detection.attachSurfaceProxy(id, mesh.proxy);
  }
  for (const CollisionProblem::Pair& pair : problem.pairs) {
    detection.addCollisionPair(GeometryId{pair.a}, GeometryId{pair.b}, pair.settings);
    if (!pair.sides.empty())
      detection.setRememberedSides(GeometryId{pair.a}, GeometryId{pair.b}, pair.sides);
  }
}

/// Throws what readCapture() would throw.
void checkReadable(const CollisionProblem& problem) {
  Settings written;  // those that a capture holds
  written.engine = problem.settings.engine;
  written.threads = problem.settings.threads;
  written.octree = problem.settings.octree;
  OctreeBasedCD detection(written);
  fill(detection, problem);
}

}  // namespace

void writeCapture(const CollisionProblem& problem, const std::filesystem::path& path) {
  const StandardFloatingPoint standard;
  for (const CollisionProblem::Geometry& geometry : problem.geometries)
    if (geometry.field || geometry.proxy)
      throw Error(ErrorCode::NotAvailable,
                  "geometry " + std::to_string(static_cast<std::uint32_t>(geometry.id)) + " has " +
                      (geometry.field ? "a distance field" : "the leaves of a proxy") +
                      ", which a capture cannot hold; CollisionProblem holds it",
                  geometry.id);
  checkReadable(problem);
  writeWholeFile(path, textOf(problem), "the capture");
}

void capture(const OctreeBasedCD& detection, const std::filesystem::path& path) {
  writeCapture(detection.problem(), path);
}

void capture(const OctreeBasedCD& detection, const AuditFailure& failure,
             const std::filesystem::path& path) {
  const StandardFloatingPoint standard;
  writeCapture(reducedToPair(detection.problem(), failure.a, failure.b), path);
}

CollisionProblem readCapture(const std::filesystem::path& path) {
  const StandardFloatingPoint standard;
  Reader file(path, readWholeFile(path, "the capture"));
  if (!file.rest().starts_with(kTitle)) file.failWhole("it is not a capture");
  file.expect(kTitle);
  int version = 0;
  file.integer(version);
  if (version < 1 || version > kVersion)
    file.failWhole("its version is " + std::to_string(version) + "; versions up to " +
                   std::to_string(kVersion) + " can be read");
  CollisionProblem problem;
  problemLines(file, problem, version);
  if (version == 1)  // Auto then stood for the one method in pair.method
    for (CollisionProblem::Pair& pair : problem.pairs) pair.settings.method = pair.method;
  file.expectEnd();
  try {
    // The check does not start the threads that the file asks for.
    checked(problem.settings);
    const int threads = std::exchange(problem.settings.threads, 1);
    setUp(problem);
    problem.settings.threads = threads;
  } catch (const Error& error) {
    file.failWhole(error.what());
  }
  return problem;
}

OctreeBasedCD setUp(const CollisionProblem& problem) {
  const StandardFloatingPoint standard;
  OctreeBasedCD detection(problem.settings);
  fill(detection, problem);
  return detection;
}

}  // namespace palpate
