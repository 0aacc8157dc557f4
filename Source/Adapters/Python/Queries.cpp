// Part of Python/Classes.h: points and bodies.

#include "Python/Classes.h"
#include "Python/Collisions.h"
#include "Python/Records.h"

namespace palpate::python {
namespace {

using Object = const py::object&;

py::object closestPoint(const Queries& self, Object geometry, Object point, double maxDistance) {
  const GeometryId id = geometryId(geometry);
  const Eigen::Vector3d p = position(point, "point");
  return recordOf(
      self.ask([&](const SpatialQueries& q) { return q.closestPoint(id, p, maxDistance); }));
}

py::array closestPoints(const Queries& self, Object geometry, Object points, double maxDistance) {
  const GeometryId id = geometryId(geometry);
  const Positions p(points, "points");
  py::array result = newRecords<SurfacePoint>(p.size());
  const std::span<SurfacePoint> out = recordsIn<SurfacePoint>(result);
  self.askLong([&](const SpatialQueries& q) { q.closestPoints(id, p.span(), out, maxDistance); });
  return result;
}

py::array nearestElements(const Queries& self, Object geometry, Object point, int k,
                          double maxDistance) {
  const GeometryId id = geometryId(geometry);
  const Eigen::Vector3d p = position(point, "point");
  std::vector<SurfacePoint> out;
  self.ask([&](const SpatialQueries& q) { q.nearestElements(id, p, k, out, maxDistance); });
  return recordsOf(out);
}

/// Of one point, or of each of many.
py::object contains(const Queries& self, Object body, Object points, Object settings,
                    const py::kwargs& keywords) {
  const GeometryId id = geometryId(body);
  const auto inside = settingsOf<InsideSettings>(settings, keywords);
  if (py::array::ensure(points).ndim() == 1) {
    const Eigen::Vector3d p = position(points, "point");
    return py::bool_(self.ask([&](const SpatialQueries& q) { return q.contains(id, p, inside); }));
  }
  const Positions p(points, "points");
  auto result = newArray<bool>(p.size());
  bool* out = result.mutable_data();
  self.askLong([&](const SpatialQueries& q) {
    for (const Eigen::Vector3d& point : p.span()) *out++ = q.contains(id, point, inside);
  });
  return result;
}

py::object signedDistance(const Queries& self, Object body, Object point, Object settings,
                          const py::kwargs& keywords) {
  const GeometryId id = geometryId(body);
  const Eigen::Vector3d p = position(point, "point");
  const auto inside = settingsOf<InsideSettings>(settings, keywords);
  return recordOf(
      self.ask([&](const SpatialQueries& q) { return q.signedDistance(id, p, inside); }));
}

py::array signedDistances(const Queries& self, Object body, Object points, Object settings,
                          const py::kwargs& keywords) {
  const GeometryId id = geometryId(body);
  const Positions p(points, "points");
  const auto inside = settingsOf<InsideSettings>(settings, keywords);
  py::array result = newRecords<SignedDistance>(p.size());
  const std::span<SignedDistance> out = recordsIn<SignedDistance>(result);
  self.askLong([&](const SpatialQueries& q) { q.signedDistances(id, p.span(), out, inside); });
  return result;
}

py::array elementsWithin(const Queries& self, Object geometry, Object point, double radius) {
  const GeometryId id = geometryId(geometry);
  const Eigen::Vector3d p = position(point, "point");
  std::vector<std::uint32_t> elements;
  self.ask([&](const SpatialQueries& q) { q.elementsWithin(id, p, radius, elements); });
  return copyOf(elements);
}

}  // namespace

void addQueries(py::module_& module) {
  py::class_<Queries> queries(module, "SpatialQueries", R"(Spatial queries over the geometries now.

Get it from OctreeBasedCD.queries() or from a Snapshot. It is valid until positions, transforms,
topology or geometries change, or advance() is called; afterwards its methods raise Error
INVALID_CALL. That of a snapshot stays valid. Points are (3,) or (n, 3), L, in the world. Results
are NumPy records, with fields as items and, of a single record, as attributes. Batches run on all
threads and release the GIL.)");
  queries
      .def("closest_point", &closestPoint, py::arg("geometry"), py::arg("point"),
           py::arg("max_distance") = kInfinity,
           R"(closest_point(geometry, point, max_distance=inf) -> numpy.record | None

The nearest surface point within max_distance (L): geometry, element, vertices (3,), weights (3,),
position (3,) and distance (L).)")
      .def("closest_points", &closestPoints, py::arg("geometry"), py::arg("points"),
           py::arg("max_distance") = kInfinity,
           R"(closest_points(geometry, points, max_distance=inf) -> numpy.ndarray

The nearest surface point of each of many points (n, 3), as records (n,). Without an answer the
distance is infinite.)")
      .def("nearest_elements", &nearestElements, py::arg("geometry"), py::arg("point"),
           py::arg("k"), py::arg("max_distance") = kInfinity,
           R"(nearest_elements(geometry, point, k, max_distance=inf) -> numpy.ndarray

The k nearest elements with their closest points, by distance.)")
      .def("contains", &contains, py::arg("body"), py::arg("points"),
           py::arg("settings") = py::none(),
           R"(contains(body, points, settings=None, **keywords) -> bool | numpy.ndarray

Whether a point (3,) is inside a body, or (n,) bool for points (n, 3). Keywords are those of
InsideSettings.)")
      .def("signed_distance", &signedDistance, py::arg("body"), py::arg("point"),
           py::arg("settings") = py::none(),
           R"(signed_distance(body, point, settings=None, **keywords) -> numpy.record

The distance from a body's surface (L), negative inside, and the nearest surface point.)")
      .def("signed_distances", &signedDistances, py::arg("body"), py::arg("points"),
           py::arg("settings") = py::none(),
           R"(signed_distances(body, points, settings=None, **keywords) -> numpy.ndarray

The same for points (n, 3), as records (n,) with distance (L) and nearest.)")
      .def("elements_within", &elementsWithin, py::arg("geometry"), py::arg("point"),
           py::arg("radius"),
           R"(elements_within(geometry, point, radius) -> numpy.ndarray

(m,) elements with a point within the radius (L), ascending.)")
      .def("__repr__", [](const Queries& self) {
        return std::string(self.owner ? "<palpate.SpatialQueries of an OctreeBasedCD>"
                                      : "<palpate.SpatialQueries of a Snapshot>");
      });
  addRays(queries);
  addBodies(module, queries);
}

}  // namespace palpate::python
