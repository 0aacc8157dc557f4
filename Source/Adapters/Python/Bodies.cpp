// Part of Python/Classes.h: elements in shapes, contacts and penetrations of bodies.

#include "Python/Classes.h"
#include "Python/Collisions.h"
#include "Python/Records.h"

namespace palpate::python {
namespace {

using Object = const py::object&;

/// The object behind palpate.RigidMesh. Its queries change the mesh.
struct Tool {
  RigidMesh mesh;
  Gate gate;
};

/// The object behind palpate.PenetrationTracker. It keeps the queries' owner alive.
struct Tracker {
  PenetrationTracker tracker;
  GeometryId vertices, body;
};

py::array overlapping(const Queries& self, Object geometry, Object shape, Object pose) {
  const GeometryId id = geometryId(geometry);
  const AnalyticalGeometry value = shapeOf(shape);
  const Pose at = pose.is_none() ? Pose{} : poseOf(pose);
  std::vector<std::uint32_t> elements;
  self.ask([&](const SpatialQueries& q) { q.overlapping(id, value, at, elements); });
  return copyOf(elements);
}

py::object contacts(const Queries& self, Object geometry, Object shape, Object pose,
                    double thickness) {
  const GeometryId id = geometryId(geometry);
  const Pose at = pose.is_none() ? Pose{} : poseOf(pose);
  if (py::isinstance<Tool>(shape)) {
    auto& tool = shape.cast<Tool&>();
    const Passage passage(tool.gate, true);
    auto data = std::make_shared<CollisionData>();
    self.askLong([&](const SpatialQueries& q) { q.contacts(id, tool.mesh, at, thickness, *data); });
    return py::cast(data);
  }
  const AnalyticalGeometry value = shapeOf(shape);
  std::vector<ShapeContact> out;
  self.ask([&](const SpatialQueries& q) { q.contacts(id, value, at, thickness, out); });
  return recordsOf(out);
}

py::object distance(const Queries& self, Object first, Object second) {
  const GeometryId a = geometryId(first), b = geometryId(second);
  return recordOf(self.askLong([&](const SpatialQueries& q) { return q.distance(a, b); }));
}

py::object penetration(const Queries& self, Object first, Object second) {
  const GeometryId a = geometryId(first), b = geometryId(second);
  return recordOf(self.askLong([&](const SpatialQueries& q) { return q.penetration(a, b); }));
}

py::array pierce(const Queries& self, Object first, Object second, Object pairs) {
  const GeometryId a = geometryId(first), b = geometryId(second);
  const IndexArray elements(pairs, 2, "pairs");
  const std::span<const std::uint32_t> ids = elements.all();
  py::array_t<bool> answers = newArray<bool>(ids.size() / 2);
  bool* const out = answers.mutable_data();
  self.askLong([&](const SpatialQueries& q) {
    for (std::size_t i = 0; i < ids.size() / 2; ++i)
      out[i] = q.pierce(a, ids[2 * i], b, ids[2 * i + 1]);
  });
  return answers;
}

py::array findInsideVertices(const Queries& self, Object vertices, Object body, Object settings,
                             const py::kwargs& keywords) {
  const GeometryId of = geometryId(vertices), in = geometryId(body);
  const auto inside = settingsOf<InsideSettings>(settings, keywords);
  std::vector<InsideVertex> out;
  self.askLong([&](const SpatialQueries& q) { q.findInsideVertices(of, in, out, inside); });
  return recordsOf(out);
}

py::array findEmbeddedVertices(const Queries& self, Object vertices, Object body) {
  const GeometryId of = geometryId(vertices), in = geometryId(body);
  std::vector<EmbeddedVertex> out;
  self.askLong([&](const SpatialQueries& q) { q.findEmbeddedVertices(of, in, out); });
  return recordsOf(out);
}

py::object findTetrahedron(const Queries& self, Object body, Object point) {
  const GeometryId id = geometryId(body);
  const Eigen::Vector3d p = position(point, "point");
  return recordOf(self.ask([&](const SpatialQueries& q) { return q.findTetrahedron(id, p); }));
}

}  // namespace

void addBodies(py::module_& module, py::class_<Queries>& queries) {
  py::class_<Tool>(module, "RigidMesh", R"(A small rigid mesh that SpatialQueries.contacts() places.

RigidMesh(positions, triangles): (n, 3), L, in the mesh's own frame, and (m, 3) vertex indices. Use
it in one call at a time.)")
      .def(py::init([](Object positions, Object triangles) {
             const Positions p(positions, "positions");
             const Elements<3> t(triangles, "triangles");
             return std::unique_ptr<Tool>(new Tool{RigidMesh(p.span(), t.span()), {}});
           }),
           py::arg("positions"), py::arg("triangles"))
      .def("__repr__", [](const Tool&) { return "<palpate.RigidMesh>"; });
  queries
      .def("overlapping", &overlapping, py::arg("geometry"), py::arg("shape"),
           py::arg("pose") = py::none(),
           R"(overlapping(geometry, shape, pose=None) -> numpy.ndarray

(m,) elements that have a point in a shape at a Pose, ascending.)")
      .def("contacts", &contacts, py::arg("geometry"), py::arg("shape"),
           py::arg("pose") = py::none(), py::arg("thickness") = 0.0,
           R"(contacts(geometry, shape, pose=None, thickness=0.0) -> numpy.ndarray | CollisionData

The contacts that a pair of the geometry and the shape at a Pose would have by PROXIMITY: records as
CollisionData.shape, or CollisionData for a RigidMesh. thickness: L.)")
      .def("distance", &distance, py::arg("a"), py::arg("b"),
           R"(distance(a, b) -> numpy.record

The least distance of two geometries (L) and their closest points a and b.)")
      .def("penetration", &penetration, py::arg("a"), py::arg("b"),
           R"(penetration(a, b) -> numpy.record

How moving a by depth * direction separates two closed bodies: intersecting, direction (3,), depth
(L), the points a and b that meet last, and minimal.)")
      .def("pierce", &pierce, py::arg("a"), py::arg("b"), py::arg("pairs"),
           R"(pierce(a, b, pairs) -> numpy.ndarray

Whether two surfaces pierce each other in two of their elements, (n,) bool; else they only touch
there, or are apart. pairs: (n, 2), an element of a and one of b. a and b may be one mesh.)")
      .def("find_inside_vertices", &findInsideVertices, py::arg("vertices"), py::arg("body"),
           py::arg("settings") = py::none(),
           R"(find_inside_vertices(vertices, body, settings=None, **keywords) -> numpy.ndarray

The vertices of one geometry inside another, as records: vertex, triangle, vertices (3,), weights
(3,), direction (3,), depth (L), decided. Keywords are those of InsideSettings.)")
      .def("find_embedded_vertices", &findEmbeddedVertices, py::arg("vertices"), py::arg("body"),
           R"(find_embedded_vertices(vertices, body) -> numpy.ndarray

The vertices of one geometry in tetrahedra of another, as records: vertex, and at with tetrahedron,
vertices (4,) and weights (4,).)")
      .def("find_tetrahedron", &findTetrahedron, py::arg("body"), py::arg("point"),
           R"(find_tetrahedron(body, point) -> numpy.record | None

The tetrahedron that contains a point: tetrahedron, vertices (4,), weights (4,).)");
  py::class_<Tracker>(module, "PenetrationTracker",
                      R"(Penetration directions of vertices that are stable over time.

PenetrationTracker(vertices, body): ids of the geometries whose queries update() receives.)")
      .def(py::init([](Object vertices, Object body) {
             const GeometryId of = geometryId(vertices), in = geometryId(body);
             return std::unique_ptr<Tracker>(new Tracker{PenetrationTracker(of, in), of, in});
           }),
           py::arg("vertices"), py::arg("body"))
      .def(
          "update",
          [](Tracker& self, const Queries& now) {
            return now.ask(
                [&](const SpatialQueries& q) { return recordsOf(self.tracker.update(q)); });
          },
          py::arg("queries"),
          R"(update(queries) -> numpy.ndarray

The vertices inside the body in this step, as records: penetration and nearest, as those of
find_inside_vertices(), and change, a DirectionChange as a number. Call it in each step.)")
      .def("__repr__", [](const Tracker& self) {
        return "<palpate.PenetrationTracker of geometry " +
               std::to_string(static_cast<std::uint32_t>(self.vertices)) + " in geometry " +
               std::to_string(static_cast<std::uint32_t>(self.body)) + ">";
      });
}

}  // namespace palpate::python
