#include <palpate/Capture.h>

#include "CollisionDetection/Audit.h"
#include "Geometry/Shape.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <fstream>
#include <iterator>
#include <string>
#include <string_view>
#include <system_error>
#include <type_traits>
#include <utility>

namespace palpate {

namespace {

constexpr std::string_view kTitle = "palpate-capture";
constexpr int kVersion = 6;

// Values of enumerations are written by name: in the order of their declarations.
constexpr std::array<std::string_view, 6> kMethods{"Auto",         "Proxy",     "DistanceField",
                                                   "Intersection", "Proximity", "Continuous"};
constexpr std::array<std::string_view, 4> kKinds{"Triangles", "Lines", "Points", "Shape"};
constexpr std::array<std::string_view, 2> kSides{"Both", "Outer"};
constexpr std::array<std::string_view, 6> kShapes{"Sphere", "Capsule",  "Plane",
                                                  "Box",    "Cylinder", "ConvexHull"};
constexpr std::array<std::string_view, 3> kContacts{"Distinct", "All", "Earliest"};
constexpr std::array<std::string_view, 2> kEngines{"Octree", "BruteForce"};
constexpr std::array<std::string_view, 2> kUpdates{"Auto", "Rebuild"};

std::string quoted(std::string_view text) { return std::string("\"").append(text).append("\""); }

/// A text of words, with lines for people.
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
  void position(const Eigen::Vector3d& p) {
    for (int k = 0; k < 3; ++k) real(p[k]);
  }
  void endLine() { m_text.back() = '\n'; }
  const std::string& text() const { return m_text; }

 private:
  std::string m_text;
};

/// The same, read. Throws Error (ErrorCode::File) that names the file and the line.
class Reader {
 public:
  Reader(const std::filesystem::path& path, std::string text)
      : m_name("the capture \"" + path.string() + "\""), m_text(std::move(text)), m_rest(m_text) {}

  std::string_view word() {
    constexpr std::string_view kSpaces = " \t\r\n";
    const std::size_t begin = std::min(m_rest.find_first_not_of(kSpaces), m_rest.size());
    m_line += std::count(m_rest.begin(), m_rest.begin() + static_cast<std::ptrdiff_t>(begin), '\n');
    m_rest.remove_prefix(begin);
    if (m_rest.empty()) refuse("it is cut off");
    const std::size_t size = std::min(m_rest.find_first_of(kSpaces), m_rest.size());
    const std::string_view found = m_rest.substr(0, size);
    m_rest.remove_prefix(size);
    return found;
  }
  void expect(std::string_view text) {
    if (const std::string_view found = word(); found != text)
      refuse(quoted(found) + " where " + quoted(text) + " should be");
  }
  template <class Enumerator, std::size_t size>
  void word(Enumerator& value, const std::array<std::string_view, size>& names) {
    const std::string_view found = word();
    const auto place = std::find(names.begin(), names.end(), found);
    if (place == names.end()) refuse(quoted(found) + " is not a name known here");
    value = static_cast<Enumerator>(place - names.begin());
  }
  template <class Integer>
  void integer(Integer& value) {
    const std::string_view found = word();
    if (const auto [end, fault] = std::from_chars(found.begin(), found.end(), value);
        end != found.end() || fault != std::errc())
      refuse(quoted(found) + " is not an integer in range");
  }
  void real(double& value) {
    const std::string_view found = word();
    if (const auto [end, fault] =
            std::from_chars(found.begin(), found.end(), value, std::chars_format::hex);
        end != found.end() || fault != std::errc())
      refuse(quoted(found) + " is not a number");
  }
  void position(Eigen::Vector3d& p) {
    for (int k = 0; k < 3; ++k) real(p[k]);
  }
  /// How many of something follow: never more than the file has characters.
  std::size_t count() {
    std::size_t value = 0;
    integer(value);
    if (value > m_rest.size()) refuse("it is cut off: too few lines for " + std::to_string(value));
    return value;
  }
  void expectEnd() {
    if (m_rest.find_first_not_of(" \t\r\n") != m_rest.npos) refuse("more follows after its end");
  }
  std::string_view rest() const { return m_rest; }
  [[noreturn]] void refuse(const std::string& reason) const {
    throw Error(ErrorCode::File, m_name + ", line " + std::to_string(m_line) + ": " + reason);
  }
  [[noreturn]] void refuseWhole(const std::string& reason) const {
    throw Error(ErrorCode::File, m_name + ": " + reason);
  }

 private:
  std::string m_name, m_text;
  std::string_view m_rest;
  std::ptrdiff_t m_line = 1;
};

/// The lines of a file, either way: `file` is a Writer or a Reader.
template <class File, class SettingsType>
void settingsLine(File& file, SettingsType& settings) {
  file.word(settings.engine, kEngines);
  file.integer(settings.threads);
  file.integer(settings.octree.maxDepth);
  file.integer(settings.octree.maxPrimitivesPerLeaf);
  file.word(settings.octree.update, kUpdates);
}

template <class File, class PairType>
void pairLine(File& file, PairType& pair, int version) {
  file.integer(pair.a);
  file.integer(pair.b);
  file.word(pair.settings.method, kMethods);
  file.word(pair.method, kMethods);
  file.real(pair.settings.thickness);
  file.word(pair.settings.contacts, kContacts);
  if (version >= 2) file.real(pair.settings.tolerance);
  if (version >= 3) file.real(pair.settings.restDistance);
  if (version >= 4) {
    int predicate = pair.predicate;
    file.integer(predicate);
    if constexpr (!std::is_const_v<PairType>) pair.predicate = predicate != 0;
  }
  if (version >= 6) file.real(pair.settings.timeTolerance);
}

template <class File, class FilterType>
void filterOf(File& file, FilterType& filter) {
  file.integer(filter.groups);
  file.integer(filter.mask);
  file.word(filter.sidedness, kSides);
}

void fieldOf(Writer& file, const Eigen::Vector3d& value) { file.position(value); }
void fieldOf(Writer& file, double value) { file.real(value); }
void fieldOf(Writer& file, bool value) { file.integer(int{value}); }
void fieldOf(Writer& file, const std::vector<Eigen::Vector3d>& value) {
  file.integer(value.size());
  for (const Eigen::Vector3d& p : value) file.position(p);
}
void fieldOf(Reader& file, std::vector<Eigen::Vector3d>& value) {
  value.resize(file.count());
  for (Eigen::Vector3d& p : value) file.position(p);
}
void fieldOf(Reader& file, Eigen::Vector3d& value) { file.position(value); }
void fieldOf(Reader& file, double& value) { file.real(value); }
void fieldOf(Reader& file, bool& value) {
  int number = 0;
  file.integer(number);
  value = number != 0;
}

/// A shape's measures and where it is.
template <class File, class MeshType>
void shapeOf(File& file, MeshType& mesh) {
  forEachField(*mesh.analytical, [&](std::string_view, auto& field) { fieldOf(file, field); });
  for (int k = 0; k < 3; ++k) {
    for (int i = 0; i < 3; ++i) fieldOf(file, mesh.rotation(k, i));
    fieldOf(file, mesh.translation[k]);
  }
}

/// The kind of shape by its number.
template <std::size_t... kinds>
AnalyticalGeometry shapeOfKind(std::size_t kind, std::index_sequence<kinds...>) {
  AnalyticalGeometry shape;
  (void)((kind == kinds && (shape.emplace<kinds>(), true)) || ...);
  return shape;
}

std::string textOf(const CollisionProblem& problem) {
  Writer file;
  file.word(kTitle);
  file.integer(kVersion);
  file.endLine();
  settingsLine(file, problem.settings);
  file.endLine();
  file.integer(problem.geometries.size());
  file.integer(problem.pairs.size());
  file.endLine();
  for (const CollisionProblem::Mesh& mesh : problem.geometries) {
    file.word("geometry");
    file.integer(static_cast<std::uint32_t>(mesh.id));
    file.integer(mesh.now.size());
    file.integer(mesh.triangles.size());
    file.word(mesh.kind, kKinds);
    file.integer(mesh.radii.size());
    for (const double radius : mesh.radii) file.real(radius);
    if (mesh.analytical) {
      file.word(mesh.analytical->index(), kShapes);
      shapeOf(file, mesh);
    }
    filterOf(file, mesh.filter);
    file.integer(mesh.disabled.size());
    for (const std::uint32_t element : mesh.disabled) file.integer(element);
    file.integer(mesh.rest.size());
    file.endLine();
    for (std::size_t v = 0; v < mesh.now.size(); ++v) {
      file.position(mesh.before.at(v));
      file.position(mesh.now[v]);
      if (!mesh.rest.empty()) file.position(mesh.rest.at(v));
      file.endLine();
    }
    for (const Triangle& triangle : mesh.triangles) {
      for (const std::uint32_t corner : triangle) file.integer(corner);
      file.endLine();
    }
  }
  for (const CollisionProblem::Pair& pair : problem.pairs) {
    file.word("pair");
    pairLine(file, pair, kVersion);
    file.endLine();
  }
  file.word("end");
  file.endLine();
  return file.text();
}

CollisionProblem::Mesh readMesh(Reader& file, int version) {
  file.expect("geometry");
  CollisionProblem::Mesh mesh;
  std::uint32_t id = 0;
  file.integer(id);
  mesh.id = GeometryId{id};
  mesh.now.resize(file.count());
  mesh.before.resize(mesh.now.size());
  mesh.triangles.resize(file.count());
  if (version >= 3) {
    file.word(mesh.kind, kKinds);
    mesh.radii.resize(file.count());
    for (double& radius : mesh.radii) file.real(radius);
    if (mesh.kind == GeometryKind::Shape) {
      std::size_t kind = 0;
      file.word(kind, kShapes);
      mesh.analytical = shapeOfKind(kind, std::make_index_sequence<kShapes.size()>());
      shapeOf(file, mesh);
    }
  }
  bool rest = mesh.kind == GeometryKind::Lines;
  if (version >= 4) {
    filterOf(file, mesh.filter);
    mesh.disabled.resize(file.count());
    for (std::uint32_t& element : mesh.disabled) file.integer(element);
    rest = file.count() > 0;
  }
  if (rest) mesh.rest.resize(mesh.now.size());
  for (std::size_t v = 0; v < mesh.now.size(); ++v) {
    file.position(mesh.before[v]);
    file.position(mesh.now[v]);
    if (rest) file.position(mesh.rest[v]);
  }
  for (Triangle& triangle : mesh.triangles)
    for (std::uint32_t& corner : triangle) file.integer(corner);
  return mesh;
}

GeometryId add(OctreeBasedCD& detection, const CollisionProblem::Mesh& mesh) {
  if (mesh.analytical) return detection.addAnalyticalGeometry(*mesh.analytical);
  const std::vector<Eigen::Vector3d>& rest = mesh.rest.empty() ? mesh.now : mesh.rest;
  if (mesh.kind == GeometryKind::Triangles) return detection.addTriangleMesh(rest, mesh.triangles);
  const bool one = mesh.radii.size() <= 1;
  const double radius = one && !mesh.radii.empty() ? mesh.radii.front() : 0.0;
  if (mesh.kind == GeometryKind::Points)
    return one ? detection.addPointSet(mesh.now, radius)
               : detection.addPointSet(mesh.now, mesh.radii);
  std::vector<Segment> segments;
  for (const auto& [p, q, _] : mesh.triangles) segments.push_back({p, q});
  return one ? detection.addLineMesh(rest, segments, radius)
             : detection.addLineMesh(rest, segments, mesh.radii);
}

std::string contentOf(const std::filesystem::path& path) {
  std::error_code fault;
  std::ifstream file(path, std::ios::binary);
  if (!file.is_open() || !std::filesystem::is_regular_file(path, fault))
    throw Error(ErrorCode::File, "the capture \"" + path.string() + "\" cannot be read");
  return {std::istreambuf_iterator<char>(file), {}};
}

}  // namespace

void writeCapture(const CollisionProblem& problem, const std::filesystem::path& path) {
  std::filesystem::path partial = path;
  partial += ".part";
  std::ofstream file(partial, std::ios::binary);
  file << textOf(problem);
  file.close();
  std::error_code fault, ignored;
  if (file.good()) std::filesystem::rename(partial, path, fault);
  if (file.good() && !fault) return;
  std::filesystem::remove(partial, ignored);
  throw Error(ErrorCode::File, "the capture \"" + path.string() + "\" cannot be written");
}

void capture(const OctreeBasedCD& detection, const std::filesystem::path& path) {
  writeCapture(detection.problem(), path);
}

void capture(const OctreeBasedCD& detection, const AuditFailure& failure,
             const std::filesystem::path& path) {
  writeCapture(pairAlone(detection.problem(), failure.a, failure.b), path);
}

CollisionProblem readCapture(const std::filesystem::path& path) {
  Reader file(path, contentOf(path));
  if (!file.rest().starts_with(kTitle)) file.refuseWhole("it is not a capture");
  file.expect(kTitle);
  int version = 0;
  file.integer(version);
  if (version < 1 || version > kVersion)
    file.refuseWhole("it is of version " + std::to_string(version) + "; versions up to " +
                     std::to_string(kVersion) + " can be read");
  CollisionProblem problem;
  settingsLine(file, problem.settings);
  problem.geometries.resize(file.count());
  problem.pairs.resize(file.count());
  for (CollisionProblem::Mesh& mesh : problem.geometries) mesh = readMesh(file, version);
  for (CollisionProblem::Pair& pair : problem.pairs) {
    file.expect("pair");
    pairLine(file, pair, version);
    if (version == 1) pair.settings.method = pair.method;  // Auto stood for one method then
  }
  file.expect("end");
  file.expectEnd();
  try {
    setUp(problem);
  } catch (const Error& error) {
    file.refuseWhole(error.what());
  }
  return problem;
}

OctreeBasedCD setUp(const CollisionProblem& problem) {
  OctreeBasedCD detection(problem.settings);
  for (const CollisionProblem::Mesh& mesh : problem.geometries) {
    const GeometryId id = add(detection, mesh);
    if (mesh.analytical)
      detection.setTransform(id, mesh.rotation, mesh.translation);
    else
      detection.setPositions(id, mesh.before, mesh.now);
    detection.setCollisionFilter(id, mesh.filter);
    detection.setDisabledElements(id, mesh.disabled);
  }
  for (const CollisionProblem::Pair& pair : problem.pairs)
    detection.addCollisionPair(GeometryId{pair.a}, GeometryId{pair.b}, pair.settings);
  return detection;
}

}  // namespace palpate
