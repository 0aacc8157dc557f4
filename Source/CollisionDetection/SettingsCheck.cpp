#include "CollisionDetection/SettingsCheck.h"

#include <palpate/Error.h>

#include "CollisionDetection/PairTable.h"
#include "Validity/MethodChoice.h"
#include "Math/Range.h"
#include "Math/Tolerances.h"
#include "Core/Text.h"

#include <algorithm>
#include <filesystem>
#include <limits>
#include <string>
#include <system_error>
#include <utility>

namespace palpate {

const Settings& checked(const Settings& settings) {
  const auto check = [](const char* name, auto setting, int low, int high, const char* range) {
    const int value = static_cast<int>(setting);
    if (value < low || value > high)
      throw Error(ErrorCode::InvalidSettings, std::string("settings: ") + name + " is " +
                                                  std::to_string(value) + "; it must be " + range);
  };
  constexpr int kAny = std::numeric_limits<int>::max();
  const OctreeSettings& octree = settings.octree;
  check("octree.maxDepth", octree.maxDepth, 1, 60, "in [1, 60]");
  check("octree.maxElementsPerLeaf", octree.maxElementsPerLeaf, 1, 1024, "in [1, 1024]");
  check("octree.update", octree.update, 0, 1, "Auto or Rebuild");
  check("octree.bounds", octree.bounds, 0, 2, "Box, Dop14 or Dop18");
  check("engine", settings.engine, 0, 1, "Octree or BruteForce");
  check("threads", settings.threads, 0, 1024, "in [0, 1024]");
  check("traceFrames", settings.traceFrames, 0, 10000, "in [0, 10000]");
  check("audit.features", settings.audit.features, 0, kAny, "at least 0");
  check("audit.maxFiles", settings.audit.maxFiles, 0, kAny, "at least 0");
  std::error_code fault;
  if (const auto& folder = settings.audit.folder;
      !folder.empty() && !std::filesystem::is_directory(folder, fault))
    throw Error(ErrorCode::InvalidSettings,
                "settings: audit.folder \"" + folder.string() + "\" is not a folder");
  return settings;
}

void checkField(const Geometry& a, const Geometry& b, const DistanceField* field,
                const PairSettings& settings, double largestRadius, GeometryId named) {
  const std::string pair = nameOf(a, b) + ": ";
  if (!field)
    throw Error(
        ErrorCode::UnsupportedMethod,
        pair + "Method::DistanceField needs a field: addDistanceField() or attachDistanceField()",
        named);
  if (!isWithinBand(*field, settings.thickness, largestRadius))
    throw Error(ErrorCode::InvalidSettings,
                pair + "the thickness and the largest radius are " +
                    textOf(settings.thickness + largestRadius) +
                    "; Method::DistanceField needs less than the band less the error bound, "
                    "which is " +
                    textOf(field->band() - field->errorBound()),
                named);
}

namespace {

/// Checks the settings of a pair. Throws an Error that describes the fault.
class PairCheck {
 public:
  PairCheck(const Geometry& a, const Geometry& b, const PairSettings& settings, bool isPlaced)
      : m_a(a), m_b(b), m_settings(settings), m_method(settings.method), m_isPlaced(isPlaced) {}

  const SupportedPairs& check() const {
    range();
    shapes();
    const SupportedPairs* const row =
        supportOf(m_method, m_a.body.mesh.topology.type, m_b.body.mesh.topology.type, &m_a == &m_b);
    if (!row) refuse();
    if (row->kind == PairKind::Field) {
      const bool second = answersByFieldOfSecond(m_a.body.mesh.topology.type, m_b.body.field.get());
      const Geometry &body = second ? m_b : m_a, &other = second ? m_a : m_b;
      checkField(m_a, m_b, body.body.field.get(), m_settings, other.body.mesh.largestRadius,
                 m_a.body.id);
    } else {
      lengths(*row);
    }
    return *row;
  }

 private:
  void need(bool good, const std::string& reason,
            ErrorCode code = ErrorCode::InvalidSettings) const {
    if (!good) throw Error(code, nameOf(m_a, m_b) + ": " + reason, m_a.body.id);
  }
  void support(bool supported, const std::string& reason) const {
    need(supported, reason, ErrorCode::UnsupportedMethod);
  }
  void finite(const char* which, double value, bool good, const char* rule) const {
    need(good && value <= kLargestMeasure,
         std::string(which) + " is " + textOf(value) + "; it must be " + rule);
  }

  void range() const {
    const auto [method, thickness, contacts, rest, allowedError, freeReach, tracks, crossings,
                smooths, remembers, continuous, automatic, proxy, priority] = m_settings;
    const auto [timeTolerance, earliestTimeOnly] = continuous;
    const double motionTolerance = automatic.motionTolerance, normalCone = proxy.widestNormalCone;
    finite("restDistance", rest, rest >= 0.0, kLengthRule);
    need(rest == 0.0 || (&m_a == &m_b && m_a.body.mesh.topology.type != GeometryType::Points),
         "restDistance is for a triangle or line mesh with itself");
    finite("thickness", thickness, thickness >= 0.0, kLengthRule);
    finite("motionTolerance", motionTolerance, true,
           "at most 1e+300, or negative for half the thickness");
    finite("timeTolerance", timeTolerance,
           timeTolerance >= kSmallestTimeTolerance && timeTolerance <= 1.0, "from 2^-50 to 1");
    need(contacts >= Contacts::Distinct && contacts <= Contacts::All,
         "contacts must be Distinct or All");
    need(!earliestTimeOnly || method == Method::Continuous,
         "earliestTimeOnly is for Method::Continuous only");
    support(!tracks || !earliestTimeOnly,
            "trackContacts needs contacts, and earliestTimeOnly reports none");
    const SupportedPairs* const overStep = supportOf(
        Method::Continuous, m_a.body.mesh.topology.type, m_b.body.mesh.topology.type, &m_a == &m_b);
    const bool hasPassages = (method == Method::Auto || method == Method::Continuous) &&
                             !earliestTimeOnly && overStep && overStep->kind == PairKind::Meshes;
    for (const auto& [asked, name] :
         {std::pair(crossings, "reportCrossings"), {remembers, "rememberSides"}})
      if (asked && !hasPassages)
        support(false, std::string(name) +
                           " is for Method::Auto and Continuous of meshes, lines and "
                           "points, without earliestTimeOnly");
    const bool hasFaces = m_a.body.mesh.topology.hasFaces() || m_b.body.mesh.topology.hasFaces();
    support(
        !smooths || (hasFaces && method != Method::DistanceField && method != Method::Proxy &&
                     !earliestTimeOnly),
        "smoothNormals is for contacts of a triangle or tetrahedral mesh, but not by a distance "
        "field or proxy");
    need(method >= Method::Auto && method <= Method::Proxy,
         "method is " + std::to_string(static_cast<int>(method)) +
             "; it must be Auto, Intersection, Proximity, Continuous, DistanceField or Proxy");
    finite("allowedError", allowedError, allowedError >= 0.0, kLengthRule);
    need(method != Method::Proxy || allowedError > 0.0,
         "Method::Proxy needs a positive allowedError; it is 0");
    need(method == Method::Auto || method == Method::Proxy || allowedError == 0.0,
         "allowedError is " + textOf(allowedError) +
             "; only Auto and Proxy use it, so it must be 0 for Method::" + toString(method));
    finite("freeMotionReach", freeReach, freeReach >= 0.0, kLengthRule);
    support(freeReach == 0.0 || !(m_a.body.isField() || m_b.body.isField()),
            "a distance field has no free motion; freeMotionReach must be 0");
    need(normalCone > 0.0 && normalCone <= kWidestNormalCone,
         "widestNormalCone is " + textOf(normalCone) + "; it must be above 0 and at most 1.5");
    need(method == Method::Auto || motionTolerance < 0.0,
         "motionTolerance is " + textOf(motionTolerance) +
             "; only Method::Auto uses it, so it must be negative for Method::" + toString(method));
  }

  void shapes() const {
    const auto &a = m_a.body.shape, &b = m_b.body.shape;
    const bool self = &m_a == &m_b;
    support(!self || a || !m_isPlaced, kRigidWithItself);
    support(!self || !a, "a shape cannot be tested against itself");
    support(!a || !b || !a->now.isPlane() || !b->now.isPlane(),
            "a pair of two planes is not supported");
    if (a && b && a->now.needsMinkowskiDifference(b->now)) {
      const double p = a->now.size(), q = b->now.size();
      support(std::max(p, q) <= kMaxSizeRatio * std::min(p, q),
              "the sizes of the shapes are " + textOf(p) + " and " + textOf(q) +
                  "; their ratio must be at most 2^40");
    }
  }

  /// Says why the table of support has no row.
  [[noreturn]] void refuse() const {
    const std::string types =
        nameOf(m_a.body.mesh.topology.type) + " and " + nameOf(m_b.body.mesh.topology.type);
    support(m_method != Method::Intersection,
            "Method::Intersection is for two triangle meshes, not for " + types +
                "; use Auto, Proximity or Continuous");
    support(m_method != Method::Proxy,
            "Method::Proxy is for a point set and a triangle mesh in this order, not for " + types);
    support(m_method == Method::DistanceField || m_method == Method::Auto,
            std::string("a distance field accepts only Auto and Method::DistanceField, not ") +
                toString(m_method));
    support(&m_a != &m_b, "Method::DistanceField is not for a geometry with itself");
    support(!m_a.body.isField() || !m_b.body.isField(),
            "a pair of two distance fields is not supported");
    support(!m_a.body.shape && !m_b.body.shape, "a distance field with a shape is not supported");
    checkField(m_a, m_b, nullptr, m_settings, 0.0, m_a.body.id);
    throw Error(ErrorCode::UnsupportedMethod,
                nameOf(m_a, m_b) + ": Method::" + toString(m_method) + " does not answer " + types,
                m_a.body.id);
  }

  /// Checks thickness and radii.
  void lengths(const SupportedPairs& row) const {
    const auto answered = [&](Method method) {
      return answers(method, m_settings.thickness, m_a.inStep(), m_b.inStep());
    };
    if (m_method == Method::Auto && (m_settings.reportCrossings || m_settings.rememberSides))
      return support(answered(Method::Continuous),
                     "reportCrossings and rememberSides need one radius for all vertices");
    if (m_method == Method::Auto)
      return need(
          answered(Method::Proximity) || answered(Method::Continuous),
          "Method::Auto needs a positive thickness if radii differ between vertices; it is 0");
    if (answered(m_method)) return;
    support(!row.has(kOneRadius),
            "Method::Continuous needs one radius for all vertices; Proximity and Auto do not");
    need(false,
         std::string("Method::") + toString(m_method) + " needs a positive thickness; it is 0");
  }

  const Geometry &m_a, &m_b;
  const PairSettings& m_settings;
  const Method m_method;
  const bool m_isPlaced;
};

}  // namespace

const SupportedPairs& checkPair(const Geometry& a, const Geometry& b, const PairSettings& settings,
                                bool isPlaced) {
  return PairCheck(a, b, settings, isPlaced).check();
}

}  // namespace palpate
