// Part of Python/Classes.h: rays and paths.

#include "Python/Collisions.h"
#include "Python/Records.h"

namespace palpate::python {
namespace {

using Object = const py::object&;

Ray rayOf(Object origin, Object direction, double tMin, double tMax) {
  return {position(origin, "origin"), position(direction, "direction"), tMin, tMax};
}

py::object firstHit(const Queries& self, Object geometry, Object origin, Object direction,
                    double tMin, double tMax) {
  const Ray ray = rayOf(origin, direction, tMin, tMax);
  if (geometry.is_none())
    return recordOf(self.ask([&](const SpatialQueries& q) { return q.firstHit(ray); }));
  const GeometryId id = geometryId(geometry);
  return recordOf(self.ask([&](const SpatialQueries& q) { return q.firstHit(id, ray); }));
}

bool anyHit(const Queries& self, Object geometry, Object origin, Object direction, double tMin,
            double tMax) {
  const GeometryId id = geometryId(geometry);
  const Ray ray = rayOf(origin, direction, tMin, tMax);
  return self.ask([&](const SpatialQueries& q) { return q.anyHit(id, ray); });
}

std::vector<Ray> raysOf(Object origins, Object directions, double tMin, double tMax) {
  const Positions from(origins, "origins"), along(directions, "directions");
  if (from.size() != along.size())
    throw Error(ErrorCode::InvalidSettings, "There are " + std::to_string(from.size()) +
                                                " origins and " + std::to_string(along.size()) +
                                                " directions.");
  std::vector<Ray> rays(from.size());
  for (std::size_t i = 0; i < rays.size(); ++i)
    rays[i] = {from.span()[i], along.span()[i], tMin, tMax};
  return rays;
}

py::array firstHits(const Queries& self, Object geometry, Object origins, Object directions,
                    double tMin, double tMax) {
  const GeometryId id = geometryId(geometry);
  const std::vector<Ray> rays = raysOf(origins, directions, tMin, tMax);
  py::array result = newRecords<RayHit>(rays.size());
  const std::span<RayHit> out = recordsIn<RayHit>(result);
  self.askLong([&](const SpatialQueries& q) { q.firstHits(id, rays, out); });
  return result;
}

py::tuple allHitsOfRays(const Queries& self, Object geometry, Object origins, Object directions,
                        double tMin, double tMax) {
  const GeometryId id = geometryId(geometry);
  const std::vector<Ray> rays = raysOf(origins, directions, tMin, tMax);
  std::vector<RayHit> hits;
  std::vector<std::size_t> begins;
  self.askLong([&](const SpatialQueries& q) { q.allHits(id, rays, hits, begins); });
  return py::make_tuple(
      recordsOf(hits),
      py::array_t<std::size_t>(static_cast<py::ssize_t>(begins.size()), begins.data()));
}

py::array allHits(const Queries& self, Object geometry, Object origin, Object direction,
                  double tMin, double tMax) {
  const GeometryId id = geometryId(geometry);
  const Ray ray = rayOf(origin, direction, tMin, tMax);
  std::vector<RayHit> hits;
  self.ask([&](const SpatialQueries& q) { q.allHits(id, ray, hits); });
  return recordsOf(hits);
}

py::object pick(const Queries& self, Object origin, Object direction, bool frontFacesOnly,
                double tMin, double tMax) {
  const Ray ray = rayOf(origin, direction, tMin, tMax);
  return recordOf(self.ask([&](const SpatialQueries& q) { return q.pick(ray, frontFacesOnly); }));
}

py::object path(const Queries& self, Object polyline, double radius, Object bodies) {
  const Positions points(polyline, "polyline");
  std::vector<GeometryId> ids;
  for (const py::handle body : bodies) ids.push_back(geometryId(body));
  std::vector<PathInterval> inside;
  std::vector<PathClearance> outside;
  self.askLong(
      [&](const SpatialQueries& q) { q.path(points.span(), radius, ids, inside, outside); });
  return lookedUp<PathInterval>("palpate", "Path")(recordsOf(inside), recordsOf(outside));
}

}  // namespace

void addRays(py::class_<Queries>& queries) {
  const py::arg geometry("geometry"), origin("origin"), direction("direction");
  const py::arg_v tMin("t_min", 0.0), tMax("t_max", kInfinity);
  queries
      .def("first_hit", &firstHit, geometry, origin, direction, tMin, tMax,
           R"(first_hit(geometry, origin, direction, t_min=0.0, t_max=inf) -> numpy.record | None

The first hit of the ray origin + t * direction: geometry, element, vertices (3,), weights (3,), t,
front_face, crosses. geometry None: of all geometries. Rays are watertight.)")
      .def("any_hit", &anyHit, geometry, origin, direction, tMin, tMax,
           R"(any_hit(geometry, origin, direction, t_min=0.0, t_max=inf) -> bool

Whether there is a hit.)")
      .def("first_hits", &firstHits, geometry, py::arg("origins"), py::arg("directions"), tMin,
           tMax,
           R"(first_hits(geometry, origins, directions, t_min=0.0, t_max=inf) -> numpy.ndarray

First hits of rays with origins (n, 3), L, and directions (n, 3), as records (n,). Without a hit, t
is infinite.)")
      .def("all_hits", &allHits, geometry, origin, direction, tMin, tMax,
           R"(all_hits(geometry, origin, direction, t_min=0.0, t_max=inf) -> numpy.ndarray

All hits as records, by ascending t.)")
      .def(
          "all_hits_of_rays", &allHitsOfRays, geometry, py::arg("origins"), py::arg("directions"),
          tMin, tMax,
          R"(all_hits_of_rays(geometry, origins, directions, t_min=0.0, t_max=inf) -> tuple[numpy.ndarray, numpy.ndarray]

All hits of rays with origins (n, 3), L, and directions (n, 3), as records, and begins (n + 1,): the
hits of ray i are [begins[i]:begins[i + 1]], by ascending t.)")
      .def(
          "pick", &pick, origin, direction, py::arg("front_faces_only") = false, tMin, tMax,
          R"(pick(origin, direction, front_faces_only=False, t_min=0.0, t_max=inf) -> numpy.record | None

What a ray selects among all geometries: hit, and the nearest vertex and edge (2,) of its element.)")
      .def("path", &path, py::arg("polyline"), py::arg("radius"), py::arg("bodies"),
           R"(path(polyline, radius, bodies) -> Path

Follows a ball of a radius (L) along a polyline (n, 3): the intervals in which it is inside bodies,
and its clearance from the others, as two arrays of records.)");
}

}  // namespace palpate::python
