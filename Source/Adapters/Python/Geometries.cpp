// Part of Python/Classes.h: geometries of an OctreeBasedCD.

#include "Python/Classes.h"
#include "Python/Collisions.h"

namespace palpate::python {
namespace {

/// None stands for no positions.
Positions optional(const py::object& positions, const char* name) {
  return Positions(positions.is_none() ? py::object(newArray<double>(0, 3)) : positions, name);
}

GeometryId addTriangleMesh(Collisions& self, const py::object& positions,
                           const py::object& triangles) {
  const Positions p(positions, "positions");
  const Elements<3> t(triangles, "triangles");
  return self.work([&](OctreeBasedCD& d) { return d.addTriangleMesh(p.span(), t.span()); });
}

GeometryId addTetrahedralMesh(Collisions& self, const py::object& positions,
                              const py::object& tetrahedra) {
  const Positions p(positions, "positions");
  const Elements<4> t(tetrahedra, "tetrahedra");
  return self.work([&](OctreeBasedCD& d) { return d.addTetrahedralMesh(p.span(), t.span()); });
}

GeometryId addLineMesh(Collisions& self, const py::object& positions, const py::object& segments,
                       const py::object& radius) {
  const Positions p(positions, "positions");
  const Elements<2> s(segments, "segments");
  const Numbers radii(radius, "radius");
  const bool one = radii.span().size() == 1;
  return self.work([&](OctreeBasedCD& d) {
    return one ? d.addLineMesh(p.span(), s.span(), radii.span()[0])
               : d.addLineMesh(p.span(), s.span(), radii.span());
  });
}

GeometryId addPointSet(Collisions& self, const py::object& positions, const py::object& radius) {
  const Positions p(positions, "positions");
  const Numbers radii(radius, "radius");
  const bool one = radii.span().size() == 1;
  return self.work([&](OctreeBasedCD& d) {
    return one ? d.addPointSet(p.span(), radii.span()[0]) : d.addPointSet(p.span(), radii.span());
  });
}

GeometryId addDistanceField(Collisions& self, const DistanceField& field) {
  return self.change([&](OctreeBasedCD& d) {
    return d.addDistanceField(std::make_shared<const DistanceField>(field));
  });
}

void attachDistanceField(Collisions& self, const py::object& mesh, const py::object& field) {
  std::shared_ptr<const DistanceField> shared;
  if (!field.is_none())
    shared = std::make_shared<const DistanceField>(field.cast<const DistanceField&>());
  const GeometryId id = geometryId(mesh);
  self.work([&](OctreeBasedCD& d) { d.attachDistanceField(id, shared); });
}

void attachSurfaceProxy(Collisions& self, const py::object& mesh, const py::object& settings,
                        const py::kwargs& keywords) {
  std::optional<SurfaceProxySettings> value;
  if (!settings.is_none() || !keywords.empty())
    value = settingsOf<SurfaceProxySettings>(settings, keywords);
  const GeometryId id = geometryId(mesh);
  self.work([&](OctreeBasedCD& d) { d.attachSurfaceProxy(id, value); });
}

void setPositions(Collisions& self, const py::object& geometry, const py::object& positions,
                  const py::object& second, std::optional<std::uint32_t> first) {
  const GeometryId id = geometryId(geometry);
  const Positions a(positions, "positions");
  if (first && !second.is_none())
    throw py::type_error("set_positions() takes `now` or `first`, not both");
  if (first) return self.work([&](OctreeBasedCD& d) { d.setPositions(id, *first, a.span()); });
  if (second.is_none()) return self.work([&](OctreeBasedCD& d) { d.setPositions(id, a.span()); });
  const Positions now(second, "positions now");
  self.work([&](OctreeBasedCD& d) { d.setPositions(id, a.span(), now.span()); });
}

/// (pose now), (pose before, pose now) or (rotation, translation).
void setTransform(Collisions& self, const py::object& geometry, const py::object& first,
                  const py::object& second) {
  const GeometryId id = geometryId(geometry);
  const py::handle poseClass = lookedUp<Pose>("palpate", "Pose");
  if (!py::isinstance(first, poseClass)) {
    if (second.is_none())
      throw py::type_error("set_transform() takes a Pose, or a translation too.");
    const Pose now = poseOf(poseClass(first, second));
    return self.change([&](OctreeBasedCD& d) { d.setTransform(id, now); });
  }
  const Pose pose = poseOf(first);
  if (second.is_none()) return self.change([&](OctreeBasedCD& d) { d.setTransform(id, pose); });
  const Pose now = poseOf(second);
  self.change([&](OctreeBasedCD& d) { d.setTransform(id, pose, now); });
}

py::array_t<double> bounds(Collisions& self, const py::object& geometry) {
  const GeometryId id = geometryId(geometry);
  const Eigen::AlignedBox3d box = self.read([&](OctreeBasedCD& d) { return d.bounds(id); });
  return copyOf(std::vector<Eigen::Vector3d>{box.min(), box.max()});
}

py::object surface(Collisions& self, const py::object& geometry) {
  const GeometryId id = geometryId(geometry);
  return self.read([&](OctreeBasedCD& d) {
    const TetrahedralSurface s = d.surface(id);
    return lookedUp<TetrahedralSurface>("palpate", "TetrahedralSurface")(copyOf<3>(s.triangles),
                                                                         copyOf(s.tetrahedra));
  });
}

bool has(Collisions& self, const py::object& geometry) {
  try {
    const GeometryId id = geometryId(geometry);
    return self.read([&](OctreeBasedCD& d) { return d.has(id); });
  } catch (const Error& error) {
    if (error.code() != ErrorCode::UnknownGeometry) throw;
    return false;
  }
}

}  // namespace

void addGeometries(CollisionsClass& collisions) {
  const auto id = [](auto&& function) {
    return [function]<class... Arguments>(Collisions& self, Arguments... arguments) {
      return static_cast<std::uint32_t>(function(self, arguments...));
    };
  };
  using Object = const py::object&;
  collisions
      .def(
          "add_triangle_mesh",
          [=](Collisions& self, Object p, Object t) { return id(addTriangleMesh)(self, p, t); },
          py::arg("positions"), py::arg("triangles"),
          R"(add_triangle_mesh(positions, triangles) -> int

Adds a triangle mesh and returns its id. Any set of triangles is valid.

positions  (n, 3), L
triangles  (m, 3) vertex indices; the winding gives the normal)")
      .def(
          "add_tetrahedral_mesh",
          [=](Collisions& self, Object p, Object t) { return id(addTetrahedralMesh)(self, p, t); },
          py::arg("positions"), py::arg("tetrahedra"),
          R"(add_tetrahedral_mesh(positions, tetrahedra) -> int

Adds a tetrahedral mesh, which collides with its surface().

positions   (n, 3), L
tetrahedra  (m, 4) vertex indices, in any order)")
      .def(
          "add_line_mesh",
          [=](Collisions& self, Object p, Object s, Object r) {
            return id(addLineMesh)(self, p, s, r);
          },
          py::arg("positions"), py::arg("segments"), py::arg("radius") = 0.0,
          R"(add_line_mesh(positions, segments, radius=0.0) -> int

Adds a line mesh, such as a suture or a centre line.

positions  (n, 3), L
segments   (m, 2) vertex indices
radius     L: a number, or (n,) one per vertex)")
      .def(
          "add_point_set",
          [=](Collisions& self, Object p, Object r) { return id(addPointSet)(self, p, r); },
          py::arg("positions"), py::arg("radius") = 0.0,
          R"(add_point_set(positions, radius=0.0) -> int

Adds a set of points or particles.

positions  (n, 3), L
radius     L: a number, or (n,) one per point)")
      .def(
          "add_analytical_geometry",
          [](Collisions& self, const py::object& shape) {
            const AnalyticalGeometry value = shapeOf(shape);
            return static_cast<std::uint32_t>(
                self.change([&](OctreeBasedCD& d) { return d.addAnalyticalGeometry(value); }));
          },
          py::arg("shape"),
          R"(add_analytical_geometry(shape) -> int

Adds a Sphere, Capsule, Plane, Box, Cylinder or ConvexHull. set_transform() places it.)")
      .def(
          "add_distance_field",
          [](Collisions& self, const DistanceField& field) {
            return static_cast<std::uint32_t>(addDistanceField(self, field));
          },
          py::arg("field"),
          R"(add_distance_field(field) -> int

Adds the surface of a DistanceField. set_transform() places it. Its pairs need the method
"distance_field".)")
      .def("attach_distance_field", &attachDistanceField, py::arg("mesh"), py::arg("field"),
           R"(attach_distance_field(mesh, field) -> None

Attaches a DistanceField in the frame of a rigid mesh; None detaches it.)")
      .def("attach_surface_proxy", &attachSurfaceProxy, py::arg("mesh"),
           py::arg("settings") = py::none(),
           R"(attach_surface_proxy(mesh, settings=None, **keywords) -> None

Builds and attaches the leaves of the method "proxy" for a rigid mesh. Keywords are those of
SurfaceProxySettings; without settings and keywords it detaches them.)")
      .def(
          "remove_geometry",
          [](Collisions& self, const py::object& geometry) {
            const GeometryId g = geometryId(geometry);
            self.change([&](OctreeBasedCD& d) { d.removeGeometry(g); });
          },
          py::arg("geometry"),
          "remove_geometry(geometry) -> None\n\nRemoves a geometry and all its pairs.")
      .def("has", &has, py::arg("geometry"),
           "has(geometry) -> bool\n\nWhether the geometry was added and not removed.")
      .def(
          "vertex_count",
          [](Collisions& self, const py::object& geometry) {
            const GeometryId g = geometryId(geometry);
            return self.read([&](OctreeBasedCD& d) { return d.vertexCount(g); });
          },
          py::arg("geometry"), "vertex_count(geometry) -> int\n\n0 for a shape.")
      .def(
          "positions",
          [](Collisions& self, const py::object& geometry) {
            const GeometryId g = geometryId(geometry);
            return self.read([&](OctreeBasedCD& d) { return copyOf(d.positions(g)); });
          },
          py::arg("geometry"),
          R"(positions(geometry) -> numpy.ndarray

A copy of the positions now, (n, 3), L; in the body's frame if set_transform() placed it.)")
      .def("bounds", &bounds, py::arg("geometry"),
           R"(bounds(geometry) -> numpy.ndarray

The box in the world around the geometry with its radii: (2, 3), lower and upper corner, L.)")
      .def("set_positions", &setPositions, py::arg("geometry"), py::arg("positions"),
           py::arg("now") = py::none(), py::kw_only(), py::arg("first") = py::none(),
           R"(set_positions(geometry, positions, now=None, *, first=None) -> None

Sets positions, (n, 3), L. One array sets the positions now; two arrays set the positions before and
now, both ends of the step. With `first`, one array sets the positions now of vertices from that
index on; the others keep theirs and cost nothing if few change in each step.)")
      .def(
          "set_triangles",
          [](Collisions& self, const py::object& geometry, const py::object& positions,
             const py::object& triangles) {
            const GeometryId g = geometryId(geometry);
            const Positions p(positions, "positions");
            const Elements<3> t(triangles, "triangles");
            self.work([&](OctreeBasedCD& d) { d.setTriangles(g, p.span(), t.span()); });
          },
          py::arg("geometry"), py::arg("positions"), py::arg("triangles"),
          R"(set_triangles(geometry, positions, triangles) -> None

Sets the topology of a triangle mesh, as after a cut, and its positions at both ends of the step.)")
      .def(
          "set_tetrahedra",
          [](Collisions& self, const py::object& geometry, const py::object& positions,
             const py::object& tetrahedra) {
            const GeometryId g = geometryId(geometry);
            const Positions p(positions, "positions");
            const Elements<4> t(tetrahedra, "tetrahedra");
            self.work([&](OctreeBasedCD& d) { d.setTetrahedra(g, p.span(), t.span()); });
          },
          py::arg("geometry"), py::arg("positions"), py::arg("tetrahedra"),
          R"(set_tetrahedra(geometry, positions, tetrahedra) -> None

Sets the topology of a tetrahedral mesh, and its positions at both ends of the step.)")
      .def(
          "replace_triangles",
          [](Collisions& self, const py::object& geometry, const py::object& removed,
             const py::object& added, const py::object& positions, const py::object& rest) {
            const GeometryId g = geometryId(geometry);
            const Indices ids(removed, 1, "removed");
            const Elements<3> t(added, "added");
            const Positions p = optional(positions, "new_positions"), r = optional(rest, "rest");
            return copyOf(self.work([&](OctreeBasedCD& d) {
              return d.replaceTriangles(g, ids.all(), t.span(), p.span(), r.span());
            }));
          },
          py::arg("geometry"), py::arg("removed"), py::arg("added"),
          py::arg("new_positions") = py::none(), py::arg("rest") = py::none(),
          R"(replace_triangles(geometry, removed, added, new_positions=None, rest=None) -> numpy.ndarray

A cut: removes triangles, (n,), appends vertices, (k, 3), L, at rest in this step, and adds
triangles, (m, 3). Returns the ids of those, (m,); no other id changes. rest: positions at rest of
the new vertices; None: new_positions.)")
      .def(
          "replace_tetrahedra",
          [](Collisions& self, const py::object& geometry, const py::object& removed,
             const py::object& added, const py::object& positions, const py::object& rest) {
            const GeometryId g = geometryId(geometry);
            const Indices ids(removed, 1, "removed");
            const Elements<4> t(added, "added");
            const Positions p = optional(positions, "new_positions"), r = optional(rest, "rest");
            return copyOf(self.work([&](OctreeBasedCD& d) {
              return d.replaceTetrahedra(g, ids.all(), t.span(), p.span(), r.span());
            }));
          },
          py::arg("geometry"), py::arg("removed"), py::arg("added"),
          py::arg("new_positions") = py::none(), py::arg("rest") = py::none(),
          R"(replace_tetrahedra(geometry, removed, added, new_positions=None, rest=None) -> numpy.ndarray

The same for a tetrahedral mesh, with tetrahedra, (m, 4). Triangles of surface() that stay keep
their ids.)")
      .def(
          "removed_elements",
          [](Collisions& self, const py::object& geometry) {
            const GeometryId g = geometryId(geometry);
            return self.read([&](OctreeBasedCD& d) { return copyOf(d.removedElements(g)); });
          },
          py::arg("geometry"), R"(removed_elements(geometry) -> numpy.ndarray

Ids of triangles that cuts removed, of tetrahedral meshes those of surface(), ascending.)")
      .def("surface", &surface, py::arg("geometry"),
           R"(surface(geometry) -> TetrahedralSurface

The triangles with which a tetrahedral mesh collides, as copies.)")
      .def("set_transform", &setTransform, py::arg("geometry"), py::arg("pose"),
           py::arg("now") = py::none(),
           R"(set_transform(geometry, pose) -> None
set_transform(geometry, before, now) -> None
set_transform(geometry, rotation, translation) -> None

Places a geometry: a point x of the body is at rotation @ x + translation in the world. One Pose
sets the placement now, two set both ends of the step. rotation: (3, 3); translation: (3,), L.)")
      .def(
          "transform",
          [](Collisions& self, const py::object& geometry) {
            const GeometryId g = geometryId(geometry);
            return toPython(self.read([&](OctreeBasedCD& d) { return d.transform(g); }));
          },
          py::arg("geometry"),
          "transform(geometry) -> Pose\n\nThe placement now; the identity if none was set.")
      .def(
          "set_name",
          [](Collisions& self, const py::object& geometry, const std::string& name) {
            const GeometryId g = geometryId(geometry);
            self.change([&](OctreeBasedCD& d) { d.setName(g, name); });
          },
          py::arg("geometry"), py::arg("name"),
          "set_name(geometry, name) -> None\n\nNames a geometry, for messages.")
      .def(
          "name",
          [](Collisions& self, const py::object& geometry) {
            const GeometryId g = geometryId(geometry);
            return self.read([&](OctreeBasedCD& d) { return std::string(d.name(g)); });
          },
          py::arg("geometry"), "name(geometry) -> str\n\nThe name; empty by default.")
      .def(
          "set_collision_filter",
          [](Collisions& self, const py::object& geometry, const py::object& filter,
             const py::kwargs& keywords) {
            const GeometryId g = geometryId(geometry);
            const auto value = settingsOf<CollisionFilter>(filter, keywords);
            self.change([&](OctreeBasedCD& d) { d.setCollisionFilter(g, value); });
          },
          py::arg("geometry"), py::arg("filter") = py::none(),
          R"(set_collision_filter(geometry, filter=None, **keywords) -> None

Sets which geometries this one collides with. Keywords are those of CollisionFilter.)")
      .def(
          "set_disabled_elements",
          [](Collisions& self, const py::object& geometry, const py::object& elements) {
            const GeometryId g = geometryId(geometry);
            const Indices indices(elements, 1, "elements");
            self.change([&](OctreeBasedCD& d) { d.setDisabledElements(g, indices.all()); });
          },
          py::arg("geometry"), py::arg("elements"),
          R"(set_disabled_elements(geometry, elements) -> None

Disables these elements, (n,), and enables all others.)")
      .def(
          "set_tags",
          [](Collisions& self, const py::object& geometry, const py::object& tags) {
            const GeometryId g = geometryId(geometry);
            const Indices numbers(tags, 1, "tags");
            self.change([&](OctreeBasedCD& d) { d.setTags(g, numbers.all()); });
          },
          py::arg("geometry"), py::arg("tags"),
          R"(set_tags(geometry, tags) -> None

Gives each element a number, (n,): each triangle, segment or point, of a tetrahedral mesh each
tetrahedron, or one for a shape or field.)")
      .def(
          "tags",
          [](Collisions& self, const py::object& geometry) {
            const GeometryId g = geometryId(geometry);
            return self.read([&](OctreeBasedCD& d) { return copyOf(d.tags(g)); });
          },
          py::arg("geometry"), "tags(geometry) -> numpy.ndarray\n\n(n,), or none, as a copy.");
}

}  // namespace palpate::python
