#include <palpate/Capture.h>

#include "Diagnostics/Audit.h"
#include "CollisionDetection/GeometryTable.h"
#include "CollisionDetection/ProblemDescription.h"
#include "CollisionDetection/SettingsCheck.h"
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
#include <utility>
#include <version>

namespace palpate {

namespace {

constexpr std::string_view kTitle = "palpate-capture";
using description::kVersion;

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
  static constexpr bool kReads = false;
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
  static constexpr bool kReads = true;
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

std::string textOf(const CollisionProblem& problem) {
  Writer file;
  file.word(kTitle);
  file.integer(kVersion);
  file.endLine();
  description::problemLines(file, problem, kVersion);
  return file.text();
}

void fill(OctreeBasedCD& detection, const CollisionProblem& problem) {
  for (const CollisionProblem::Geometry& mesh : problem.geometries) {
    const GeometryId id = ProblemGeometries::add(detection, mesh);
    const bool isField = mesh.type == GeometryType::Field;
    if (!mesh.analytical && !isField) detection.setPositions(id, mesh.before, mesh.now);
    const bool isPlaced = mesh.motion.before != Pose{} || mesh.motion.now != Pose{};
    if (isPlaced && (mesh.analytical || mesh.field || mesh.proxy))
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
  description::problemLines(file, problem, version);
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
