#pragma once

#include "Python/Fields.h"

#include <palpate/AnalyticalGeometry.h>
#include <palpate/Capture.h>
#include <palpate/ConstraintRows.h>
#include <palpate/FrameStatistics.h>
#include <palpate/LooseOctree.h>
#include <palpate/Meshes.h>
#include <palpate/PenetrationTracker.h>
#include <palpate/Settings.h>
#include <palpate/Validity.h>

#include <functional>

namespace palpate::python {

/// The name of a struct's or an enumeration's class in the package palpate; null: it has none.
template <class T>
inline constexpr const char* kClass = nullptr;
template <class T>
concept HasClass = kClass<T>
!= nullptr;

template <>
inline constexpr const char* kClass<GeometryType> = "GeometryType";
template <>
inline constexpr const char* kClass<OctreeUpdate> = "OctreeUpdate";
template <>
inline constexpr const char* kClass<OctreeBounds> = "OctreeBounds";
template <>
inline constexpr const char* kClass<Engine> = "Engine";
template <>
inline constexpr const char* kClass<Method> = "Method";
template <>
inline constexpr const char* kClass<Contacts> = "Contacts";
template <>
inline constexpr const char* kClass<Sidedness> = "Sidedness";
template <>
inline constexpr const char* kClass<ContactFeatures::Kind> = "ContactFeaturesKind";
template <>
inline constexpr const char* kClass<ContactKind> = "ContactKind";
template <>
inline constexpr const char* kClass<ErrorCode> = "ErrorCode";
template <>
inline constexpr const char* kClass<AuditFailure::Fault> = "AuditFailureFault";
template <>
inline constexpr const char* kClass<AuditFailure::List> = "AuditFailureList";
template <>
inline constexpr const char* kClass<MethodReason> = "MethodReason";
template <>
inline constexpr const char* kClass<InsideRule> = "InsideRule";
template <>
inline constexpr const char* kClass<LooseOctree::Update> = "LooseOctreeUpdate";

// Settings and statistics: dataclasses with the same values.

template <>
inline constexpr const char* kClass<OctreeSettings> = "OctreeSettings";
template <>
inline constexpr auto kFields<OctreeSettings> =
    std::tuple(field("max_depth", &OctreeSettings::maxDepth),
               field("max_elements_per_leaf", &OctreeSettings::maxElementsPerLeaf),
               field("update", &OctreeSettings::update), field("bounds", &OctreeSettings::bounds),
               field("keeps_pairs", &OctreeSettings::keepsPairs));
template <>
inline constexpr const char* kClass<AuditSettings> = "AuditSettings";
template <>
inline constexpr auto kFields<AuditSettings> = std::tuple(
    field("features", &AuditSettings::features), field("seed", &AuditSettings::seed),
    field("folder", &AuditSettings::folder), field("max_files", &AuditSettings::maxFiles));
template <>
inline constexpr const char* kClass<Settings> = "Settings";
template <>
inline constexpr auto kFields<Settings> = std::tuple(field("octree", &Settings::octree),
                                                     field("engine", &Settings::engine),
                                                     field("threads", &Settings::threads),
                                                     field("audit", &Settings::audit),
                                                     field("trace_frames", &Settings::traceFrames),
                                                     field("executor", &Settings::executor),
                                                     field("memory_limit", &Settings::memoryLimit));
template <>
inline constexpr const char* kClass<PairSettings> = "PairSettings";
template <>
inline constexpr auto kFields<PairSettings> = std::tuple(
    field("method", &PairSettings::method), field("thickness", &PairSettings::thickness),
    field("contacts", &PairSettings::contacts),
    field(
        "motion_tolerance", [](auto& s) -> auto& { return s.automatic.motionTolerance; }),
    field("rest_distance", &PairSettings::restDistance),
    field(
        "time_tolerance", [](auto& s) -> auto& { return s.continuous.timeTolerance; }),
    field(
        "earliest_time_only", [](auto& s) -> auto& { return s.continuous.earliestTimeOnly; }),
    field("allowed_error", &PairSettings::allowedError),
    field("free_motion_reach", &PairSettings::freeMotionReach),
    field("track_contacts", &PairSettings::trackContacts),
    field("report_crossings", &PairSettings::reportCrossings),
    field("smooth_normals", &PairSettings::smoothNormals),
    field("remember_sides", &PairSettings::rememberSides),
    field(
        "widest_normal_cone", [](auto& s) -> auto& { return s.proxy.widestNormalCone; }),
    field("priority", &PairSettings::priority));
template <>
inline constexpr const char* kClass<SurfaceProxySettings> = "SurfaceProxySettings";
template <>
inline constexpr auto kFields<SurfaceProxySettings> =
    std::tuple(field("reach", &SurfaceProxySettings::reach),
               field("error_bound", &SurfaceProxySettings::errorBound),
               field(
                   "widest_normal_cone", [](auto& s) -> auto& { return s.widestNormalCone; }));
template <>
inline constexpr const char* kClass<CollisionFilter> = "CollisionFilter";
template <>
inline constexpr auto kFields<CollisionFilter> =
    std::tuple(field("groups", &CollisionFilter::groups), field("mask", &CollisionFilter::mask),
               field("sidedness", &CollisionFilter::sidedness));
template <>
inline constexpr const char* kClass<InsideSettings> = "InsideSettings";
template <>
inline constexpr auto kFields<InsideSettings> =
    std::tuple(field("rule", &InsideSettings::rule), field("margin", &InsideSettings::margin));
template <>
inline constexpr const char* kClass<MemoryUse> = "MemoryUse";
template <>
inline constexpr auto kFields<MemoryUse> =
    std::tuple(field("geometries", &MemoryUse::geometries), field("octrees", &MemoryUse::octrees),
               field("pairs", &MemoryUse::pairs), field("narrow_phase", &MemoryUse::narrowPhase),
               field("results", &MemoryUse::results), field("queries", &MemoryUse::queries),
               field("snapshots", &MemoryUse::snapshots), field("total", &MemoryUse::total));
template <>
inline constexpr const char* kClass<FrameStatistics::Stages> = "FrameStages";
template <>
inline constexpr auto kFields<FrameStatistics::Stages> =
    std::tuple(field("boxes", &FrameStatistics::Stages::boxes),
               field("octree", &FrameStatistics::Stages::octree),
               field("pairs", &FrameStatistics::Stages::pairs),
               field("narrow_phase", &FrameStatistics::Stages::narrowPhase),
               field("order", &FrameStatistics::Stages::order));
template <>
inline constexpr const char* kClass<UnfinishedPair> = "UnfinishedPair";
template <>
inline constexpr auto kFields<UnfinishedPair> = std::tuple(
    field("a", &UnfinishedPair::a), field("b", &UnfinishedPair::b),
    field("distance_bound", &UnfinishedPair::distanceBound), field("age", &UnfinishedPair::age),
    field("exceeds_budget", &UnfinishedPair::exceedsBudget));
template <>
inline constexpr const char* kClass<FrameStatistics> = "FrameStatistics";
template <>
inline constexpr auto kFields<FrameStatistics> = std::tuple(
    field("milliseconds", &FrameStatistics::milliseconds),
    field("geometries", &FrameStatistics::geometries),
    field("triangles", &FrameStatistics::triangles), field("segments", &FrameStatistics::segments),
    field("points", &FrameStatistics::points),
    field("untested_vertices", &FrameStatistics::untestedVertices),
    field("rebuilt_octrees", &FrameStatistics::rebuiltOctrees),
    field("refitted_octrees", &FrameStatistics::refittedOctrees),
    field("unchanged_octrees", &FrameStatistics::unchangedOctrees),
    field("candidate_pairs", &FrameStatistics::candidatePairs),
    field("feature_pairs", &FrameStatistics::featurePairs),
    field("contacts", &FrameStatistics::contacts),
    field("intersecting_triangles", &FrameStatistics::intersectingTriangles),
    field("exact_decisions", &FrameStatistics::exactDecisions),
    field("validity_pairs", &FrameStatistics::validityPairs),
    field("memory", &FrameStatistics::memory), field("peak_memory", &FrameStatistics::peakMemory),
    field("unfinished_pairs", &FrameStatistics::unfinishedPairs),
    field("free_motion_unfinished", &FrameStatistics::freeMotionUnfinished));
template <>
inline constexpr const char* kClass<PairStatistics> = "PairStatistics";
template <>
inline constexpr auto kFields<PairStatistics> =
    std::tuple(field("milliseconds", &PairStatistics::milliseconds),
               field("candidate_pairs", &PairStatistics::candidatePairs),
               field("feature_pairs", &PairStatistics::featurePairs),
               field("exact_decisions", &PairStatistics::exactDecisions),
               field("contacts", &PairStatistics::contacts));
template <>
inline constexpr const char* kClass<OctreeStatistics> = "OctreeStatistics";
template <>
inline constexpr auto kFields<OctreeStatistics> =
    std::tuple(field("nodes_in_use", &OctreeStatistics::nodesInUse),
               field("nodes_allocated", &OctreeStatistics::nodesAllocated),
               field("blocks_in_use", &OctreeStatistics::blocksInUse),
               field("blocks_free", &OctreeStatistics::blocksFree),
               field("blocks_allocated", &OctreeStatistics::blocksAllocated),
               field("deepest_level", &OctreeStatistics::deepestLevel),
               field("elements", &OctreeStatistics::elements),
               field("max_elements_in_node", &OctreeStatistics::maxElementsInNode),
               field("nodes_by_depth", &OctreeStatistics::nodesByDepth),
               field("elements_by_depth", &OctreeStatistics::elementsByDepth),
               field("bytes", &OctreeStatistics::bytes));
template <>
inline constexpr const char* kClass<Validity> = "Validity";
template <>
inline constexpr auto kFields<Validity> = std::tuple(
    field("trusted", &Validity::trusted), field("started_apart", &Validity::startedApart),
    field("side_may_be_wrong", &Validity::sideMayBeWrong), field("unwelded", &Validity::unwelded),
    field("method", &Validity::method), field("reason", &Validity::reason),
    field("at_end", &Validity::atEnd), field("at_impact", &Validity::atImpact),
    field("displacement", &Validity::displacement),
    field("displacement_limit", &Validity::displacementLimit),
    field("arc_deviation", &Validity::arcDeviation),
    field("effective_thickness", &Validity::effectiveThickness),
    field("proxy_depth", &Validity::proxyDepth), field("age", &Validity::age),
    field("advance_may_be_missing", &Validity::advanceMayBeMissing),
    field("untrusted_vertices_a", &Validity::untrustedVerticesA),
    field("untrusted_vertices_b", &Validity::untrustedVerticesB),
    field("degenerate_triangles_a", &Validity::degenerateTrianglesA),
    field("degenerate_triangles_b", &Validity::degenerateTrianglesB),
    field("outside_band", &Validity::outsideBand),
    field("near_threshold", &Validity::nearThreshold),
    field("unreliable_sign", &Validity::unreliableSign));

// Shapes.

template <>
inline constexpr const char* kClass<Sphere> = "Sphere";
template <>
inline constexpr auto kFields<Sphere> = std::tuple(field("centre", &Sphere::centre),
                                                   field("radius", &Sphere::radius));
template <>
inline constexpr const char* kClass<Capsule> = "Capsule";
template <>
inline constexpr auto kFields<Capsule> = std::tuple(field("p0", &Capsule::p0),
                                                    field("p1", &Capsule::p1),
                                                    field("radius", &Capsule::radius));
template <>
inline constexpr const char* kClass<Plane> = "Plane";
template <>
inline constexpr auto kFields<Plane> = std::tuple(field("point", &Plane::point),
                                                  field("normal", &Plane::normal),
                                                  field("two_sided", &Plane::twoSided));
template <>
inline constexpr const char* kClass<Box> = "Box";
template <>
inline constexpr auto kFields<Box> = std::tuple(field("centre", &Box::centre),
                                                field("half_extents", &Box::halfExtents));
template <>
inline constexpr const char* kClass<Cylinder> = "Cylinder";
template <>
inline constexpr auto kFields<Cylinder> = std::tuple(field("p0", &Cylinder::p0),
                                                     field("p1", &Cylinder::p1),
                                                     field("radius", &Cylinder::radius));
template <>
inline constexpr const char* kClass<ConvexHull> = "ConvexHull";
template <>
inline constexpr auto kFields<ConvexHull> = std::tuple(field("points", &ConvexHull::points));

/// The class of a struct or an enumeration.
template <HasClass T>
py::handle classOf() {
  return lookedUp<T>("palpate", kClass<T>);
}

/// Tags of lookedUp().
struct ParseFunction;
struct ReplaceFunction;

/// Converts what pybind11 cannot by itself.
template <class T>
py::object toPython(const T& value) {
  if constexpr (std::is_same_v<T, Eigen::Vector3d> ||
                std::is_same_v<T, std::vector<Eigen::Vector3d>>)
    return copyOf(value);
  else
    return py::cast(value);
}
template <class T>
T fromPython(const py::handle& value, const char* name) {
  if constexpr (std::is_same_v<T, Eigen::Vector3d>) {
    return position(value, name);
  } else if constexpr (std::is_same_v<T, std::vector<Eigen::Vector3d>>) {
    const Positions positions(value, name);
    return {positions.span().begin(), positions.span().end()};
  } else if constexpr (std::is_same_v<T, std::filesystem::path>) {
    return value.cast<std::string>();
  } else if constexpr (std::is_arithmetic_v<T> && !std::is_same_v<T, bool>) {
    try {
      return value.cast<T>();
    } catch (const py::cast_error&) {
      if (!PyNumber_Check(value.ptr()))
        throw py::type_error(std::string(name) + " must be a number, not " +
                             py::repr(value).cast<std::string>());
      throw Error(ErrorCode::InvalidSettings, std::string(name) + " is " +
                                                  py::repr(value).cast<std::string>() +
                                                  ", which is no valid value.");
    }
  } else {
    return value.cast<T>();
  }
}

/// Poses of Python and of the library.
Pose poseOf(const py::handle& pose);
py::object toPython(const Pose& pose);
/// None is a body that was never placed.
RigidMotion motionOf(const py::handle& motion);
py::object toPython(const RigidMotion& motion);
AnalyticalGeometry shapeOf(const py::handle& shape);
py::object toPython(const AnalyticalGeometry& shape);

/// `settings` of the caller, or the default for None, with the given keywords changed.
template <HasClass T>
T settingsOf(const py::handle& settings, const py::dict& keywords) {
  if (settings.is_none()) return classOf<T>()(**keywords).template cast<T>();
  if (keywords.empty()) return settings.cast<T>();
  return lookedUp<ReplaceFunction>("dataclasses", "replace")(settings, **keywords)
      .template cast<T>();
}

}  // namespace palpate::python

namespace pybind11::detail {

/// Enumerations: a member of the class, its name, or its number.
template <class T>
struct type_caster<T, std::enable_if_t<std::is_enum_v<T> && palpate::python::HasClass<T>>> {
  PYBIND11_TYPE_CASTER(T, const_name("int"));
  bool load(handle source, bool) {
    const object member = palpate::python::lookedUp<palpate::python::ParseFunction>(
        "palpate._enums", "parse")(palpate::python::classOf<T>(), source);
    value = static_cast<T>(member.cast<int>());
    return true;
  }
  static handle cast(T source, return_value_policy, handle) {
    return palpate::python::classOf<T>()(static_cast<int>(source)).release();
  }
};

/// Structs: an object with the attributes of the dataclass.
template <class T>
struct type_caster<T, std::enable_if_t<std::is_class_v<T> && palpate::python::HasClass<T>>> {
  PYBIND11_TYPE_CASTER(T, const_name("object"));
  bool load(handle source, bool) {
    if (!isinstance(source, palpate::python::classOf<T>())) return false;
    palpate::python::forEachField(value, [&](const char* field, auto& member) {
      using Member = std::remove_cvref_t<decltype(member)>;
      member = palpate::python::fromPython<Member>(source.attr(field), field);
    });
    return true;
  }
  static handle cast(const T& source, return_value_policy, handle) {
    dict values;
    palpate::python::forEachField(source, [&](const char* field, const auto& member) {
      values[field] = palpate::python::toPython(member);
    });
    return palpate::python::classOf<T>()(**values).release();
  }
};

template <>
struct type_caster<palpate::GeometryId> {
  PYBIND11_TYPE_CASTER(palpate::GeometryId, const_name("int"));
  bool load(handle source, bool) {
    value = palpate::python::geometryId(source);
    return true;
  }
  static handle cast(palpate::GeometryId id, return_value_policy, handle) {
    return int_(static_cast<std::uint32_t>(id)).release();
  }
};

template <>
struct type_caster<std::filesystem::path> {
  PYBIND11_TYPE_CASTER(std::filesystem::path, const_name("str"));
  bool load(handle source, bool) {
    const auto text = reinterpret_steal<object>(PyOS_FSPath(source.ptr()));
    if (!text) throw error_already_set();
    value = text.cast<std::string>();
    return true;
  }
  static handle cast(const std::filesystem::path& source, return_value_policy, handle) {
    return pybind11::str(source.string()).release();
  }
};

}  // namespace pybind11::detail
