#pragma once

#include "Python/Fields.h"

#include <palpate/CollisionData.h>
#include <palpate/ConstraintRows.h>
#include <palpate/FeaturePairs.h>
#include <palpate/Meshes.h>
#include <palpate/PenetrationTracker.h>
#include <palpate/SpatialQueries.h>
#include <palpate/StepGuard.h>
#include <palpate/ThreadTopology.h>

#include <cstring>
#include <functional>
#include <memory>

namespace palpate::python {

// The structs of which Python gets arrays: one field of a NumPy record for each member.

template <>
inline constexpr auto kFields<VertexTriangleContact> =
    std::tuple(field("vertex", &VertexTriangleContact::vertex),
               field("triangle", &VertexTriangleContact::triangle),
               field("vertices", &VertexTriangleContact::vertices),
               field("weights", &VertexTriangleContact::weights),
               field("normal", &VertexTriangleContact::normal),
               field("distance", &VertexTriangleContact::distance),
               field("time_of_impact", &VertexTriangleContact::timeOfImpact),
               field("feature", &VertexTriangleContact::feature));
template <>
inline constexpr auto kFields<EdgeEdgeContact> = std::tuple(
    field("edge_a", &EdgeEdgeContact::edgeA), field("edge_b", &EdgeEdgeContact::edgeB),
    field("weight_a", &EdgeEdgeContact::weightA), field("weight_b", &EdgeEdgeContact::weightB),
    field("normal", &EdgeEdgeContact::normal), field("distance", &EdgeEdgeContact::distance),
    field("time_of_impact", &EdgeEdgeContact::timeOfImpact),
    field("feature_a", &EdgeEdgeContact::featureA), field("feature_b", &EdgeEdgeContact::featureB));
template <>
inline constexpr auto kFields<ElementPair> = std::tuple(field("a", &ElementPair::a),
                                                        field("b", &ElementPair::b));
template <>
inline constexpr auto kFields<ShapeContact> = std::tuple(
    field("element", &ShapeContact::element), field("id", &ShapeContact::id),
    field("vertices", &ShapeContact::vertices), field("weights", &ShapeContact::weights),
    field("point", &ShapeContact::point), field("point_on_shape", &ShapeContact::pointOnShape),
    field("normal", &ShapeContact::normal), field("distance", &ShapeContact::distance),
    field("time_of_impact", &ShapeContact::timeOfImpact));
template <>
inline constexpr auto kFields<ShapeShapeContact> = std::tuple(
    field("point_a", &ShapeShapeContact::pointA), field("point_b", &ShapeShapeContact::pointB),
    field("normal", &ShapeShapeContact::normal), field("distance", &ShapeShapeContact::distance),
    field("time_of_impact", &ShapeShapeContact::timeOfImpact));
template <>
inline constexpr auto kFields<ContactKey> = std::tuple(field("kind", &ContactKey::kind),
                                                       field("ids", &ContactKey::ids));
/// TrackedContact, without an optional member.
struct TrackedRecord {
  ContactKey key, predecessor;
  bool hasPredecessor = false;
  std::uint32_t age = 0;
  std::uint64_t userData = 0;
  ContactEnd end = ContactEnd::None;
};
template <>
inline constexpr auto kFields<TrackedRecord> = std::tuple(
    field("key", &TrackedRecord::key), field("predecessor", &TrackedRecord::predecessor),
    field("has_predecessor", &TrackedRecord::hasPredecessor), field("age", &TrackedRecord::age),
    field("user_data", &TrackedRecord::userData), field("end", &TrackedRecord::end));
template <>
inline constexpr auto kFields<Crossing> = std::tuple(field("kind", &Crossing::kind),
                                                     field("ids", &Crossing::ids),
                                                     field("time", &Crossing::time),
                                                     field("forward", &Crossing::forward));
template <>
inline constexpr auto kFields<SurfacePoint> = std::tuple(field("geometry", &SurfacePoint::geometry),
                                                         field("element", &SurfacePoint::element),
                                                         field("vertices", &SurfacePoint::vertices),
                                                         field("weights", &SurfacePoint::weights),
                                                         field("position", &SurfacePoint::position),
                                                         field("distance", &SurfacePoint::distance),
                                                         field("normal", &SurfacePoint::normal));
template <>
inline constexpr auto kFields<SignedDistance> = std::tuple(
    field("nearest", &SignedDistance::nearest), field("distance", &SignedDistance::distance));
template <>
inline constexpr auto kFields<RayHit> = std::tuple(field("geometry", &RayHit::geometry),
                                                   field("element", &RayHit::element),
                                                   field("vertices", &RayHit::vertices),
                                                   field("weights", &RayHit::weights),
                                                   field("t", &RayHit::t),
                                                   field("front_face", &RayHit::frontFace),
                                                   field("crosses", &RayHit::crosses));
template <>
inline constexpr auto kFields<Pick> = std::tuple(field("hit", &Pick::hit),
                                                 field("vertex", &Pick::vertex),
                                                 field("edge", &Pick::edge));
template <>
inline constexpr auto kFields<GeometryDistance> = std::tuple(field("a", &GeometryDistance::a),
                                                             field("b", &GeometryDistance::b),
                                                             field("distance",
                                                                   &GeometryDistance::distance));
template <>
inline constexpr auto kFields<Penetration> = std::tuple(
    field("intersecting", &Penetration::intersecting), field("direction", &Penetration::direction),
    field("depth", &Penetration::depth), field("a", &Penetration::a), field("b", &Penetration::b),
    field("minimal", &Penetration::minimal));
template <>
inline constexpr auto kFields<PathInterval> = std::tuple(
    field("body", &PathInterval::body), field("enter", &PathInterval::enter),
    field("leave", &PathInterval::leave), field("entry_element", &PathInterval::entryElement),
    field("exit_element", &PathInterval::exitElement));
template <>
inline constexpr auto kFields<PathClearance> =
    std::tuple(field("body", &PathClearance::body), field("distance", &PathClearance::distance),
               field("at", &PathClearance::at), field("nearest", &PathClearance::nearest));
template <>
inline constexpr auto kFields<InsideVertex> =
    std::tuple(field("vertex", &InsideVertex::vertex), field("triangle", &InsideVertex::triangle),
               field("vertices", &InsideVertex::vertices), field("weights", &InsideVertex::weights),
               field("direction", &InsideVertex::direction), field("depth", &InsideVertex::depth),
               field("decided", &InsideVertex::decided));
template <>
inline constexpr auto kFields<TrackedVertex> = std::tuple(field("penetration",
                                                                &TrackedVertex::penetration),
                                                          field("nearest", &TrackedVertex::nearest),
                                                          field("change", &TrackedVertex::change));
template <>
inline constexpr auto kFields<TetrahedronPoint> = std::tuple(
    field("tetrahedron", &TetrahedronPoint::tetrahedron),
    field("vertices", &TetrahedronPoint::vertices), field("weights", &TetrahedronPoint::weights));
template <>
inline constexpr auto kFields<EmbeddedVertex> = std::tuple(field("vertex", &EmbeddedVertex::vertex),
                                                           field("at", &EmbeddedVertex::at));
template <>
inline constexpr auto kFields<ConstraintRow> = std::tuple(
    field("vertices", &ConstraintRow::vertices), field("weights", &ConstraintRow::weights),
    field("normal", &ConstraintRow::normal), field("offset", &ConstraintRow::offset));
template <>
inline constexpr auto kFields<ContactMotion> =
    std::tuple(field("point", &ContactMotion::point), field("opposite", &ContactMotion::opposite),
               field("relative_displacement", &ContactMotion::relativeDisplacement));
template <>
inline constexpr auto kFields<HeldVertex> = std::tuple(field("geometry", &HeldVertex::geometry),
                                                       field("vertex", &HeldVertex::vertex),
                                                       field("fraction", &HeldVertex::fraction));
template <>
inline constexpr auto kFields<ThreadEvent> = std::tuple(field("index", &ThreadEvent::index),
                                                        field("step", &ThreadEvent::step),
                                                        field("cause", &ThreadEvent::cause),
                                                        field("change", &ThreadEvent::change),
                                                        field("thread", &ThreadEvent::thread),
                                                        field("loop", &ThreadEvent::loop),
                                                        field("time", &ThreadEvent::time));
template <>
inline constexpr auto kFields<VertexTriangleDistance> =
    std::tuple(field("weights", &VertexTriangleDistance::weights),
               field("difference", &VertexTriangleDistance::difference),
               field("normal", &VertexTriangleDistance::normal),
               field("distance", &VertexTriangleDistance::distance),
               field("feature", &VertexTriangleDistance::feature),
               field("exact", &VertexTriangleDistance::exact));
template <>
inline constexpr auto kFields<EdgeEdgeDistance> = std::tuple(
    field("weight_a", &EdgeEdgeDistance::weightA), field("weight_b", &EdgeEdgeDistance::weightB),
    field("difference", &EdgeEdgeDistance::difference), field("normal", &EdgeEdgeDistance::normal),
    field("distance", &EdgeEdgeDistance::distance), field("feature_a", &EdgeEdgeDistance::featureA),
    field("feature_b", &EdgeEdgeDistance::featureB), field("parallel", &EdgeEdgeDistance::parallel),
    field("exact", &EdgeEdgeDistance::exact));

/// The NumPy type of a member: a number, a fixed array of numbers, or the record of a struct.
template <class T>
struct Format {
  static py::object get() {
    if constexpr (std::is_enum_v<T>)
      return Format<std::underlying_type_t<T>>::get();
    else
      return py::dtype::of<T>();
  }
};
template <>
struct Format<Eigen::Vector3d> {
  static py::object get() { return py::make_tuple(py::dtype::of<double>(), py::make_tuple(3)); }
};
template <class T, std::size_t N>
struct Format<std::array<T, N>> {
  static py::object get() { return py::make_tuple(py::dtype::of<T>(), py::make_tuple(N)); }
};

/// The dtype of a struct: a numpy.record, whose fields are items and attributes.
template <HasFields T>
struct Format<T> {
  static py::dtype get() {
    static PyObject* type = nullptr;
    if (type == nullptr) {
      py::list names, formats, offsets;
      const auto object = std::make_unique<T>();
      forEachField(*object, [&](const char* name, const auto& member) {
        names.append(name);
        formats.append(Format<std::remove_cvref_t<decltype(member)>>::get());
        offsets.append(reinterpret_cast<const char*>(&member) -
                       reinterpret_cast<const char*>(object.get()));
      });
      const py::module_ numpy = py::module_::import("numpy");
      py::dict layout;
      layout["names"] = names;
      layout["formats"] = formats;
      layout["offsets"] = offsets;
      layout["itemsize"] = sizeof(T);
      const py::object fields = numpy.attr("dtype")(layout);
      type = numpy.attr("dtype")(py::make_tuple(numpy.attr("record"), fields)).release().ptr();
    }
    return py::reinterpret_borrow<py::dtype>(type);
  }
};

/// A new array of records that owns its memory.
template <HasFields T>
py::array newRecords(std::size_t count) {
  return py::array(Format<T>::get(), std::vector<py::ssize_t>{static_cast<py::ssize_t>(count)});
}
template <HasFields T>
std::span<T> recordsIn(py::array& array) {
  return {static_cast<T*>(array.mutable_data()), static_cast<std::size_t>(array.size())};
}

template <HasFields T>
py::array recordsOf(std::span<const T> records) {
  py::array array = newRecords<T>(records.size());
  if (!records.empty())
    std::memcpy(array.mutable_data(), static_cast<const void*>(records.data()),
                records.size_bytes());
  return array;
}
template <HasFields T>
py::array recordsOf(const std::vector<T>& records) {
  return recordsOf(std::span<const T>(records));
}

/// One record, which owns its memory.
template <HasFields T>
py::object recordOf(const T& record) {
  return recordsOf(std::span<const T>(&record, 1))[py::int_(0)];
}
template <HasFields T>
py::object recordOf(const std::optional<T>& record) {
  return record ? recordOf(*record) : py::none();
}

/// An array that shows records of an owner, which never change, and keeps the owner alive. It goes
/// to NumPy's own functions, because a frame makes many views: py::array allocates its shape.
template <HasFields T>
py::object viewOf(std::span<const T> records, const py::handle& owner) {
  const auto& numpy = py::detail::npy_api::get();
  const Py_intptr_t size = static_cast<Py_intptr_t>(records.size());
  static const T kNone{};  // NumPy allocates for null
  const T* first = records.empty() ? &kNone : records.data();
  auto array = py::reinterpret_steal<py::object>(numpy.PyArray_NewFromDescr_(
      numpy.PyArray_Type_, Format<T>::get().release().ptr(), 1, &size, nullptr,
      const_cast<void*>(static_cast<const void*>(first)), 0, nullptr));
  if (!array) throw py::error_already_set();
  // Steals a reference to the owner.
  if (numpy.PyArray_SetBaseObject_(array.ptr(), owner.inc_ref().ptr()) != 0)
    throw py::error_already_set();
  return array;
}

/// The structs in an array of the same records.
template <HasFields T>
std::vector<T> structsIn(const py::handle& object) {
  const auto array = py::reinterpret_borrow<py::array>(
      py::module_::import("numpy").attr("ascontiguousarray")(object, Format<T>::get()));
  std::vector<T> structs(static_cast<std::size_t>(array.size()));
  if (!structs.empty())
    std::memcpy(static_cast<void*>(structs.data()), array.data(), structs.size() * sizeof(T));
  return structs;
}

}  // namespace palpate::python
