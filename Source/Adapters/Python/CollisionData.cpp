#include "Python/Classes.h"
#include "Python/Collisions.h"
#include "Python/Records.h"
#include "Contact/ContactLists.h"

#include <algorithm>
#include <array>

namespace palpate::python {
namespace {

using DataClass = py::class_<CollisionData, std::shared_ptr<CollisionData>>;

/// A property that shows one list of contacts.
template <class T>
void addList(DataClass& data, const char* name, std::span<const T> (CollisionData::*list)() const,
             const char* text) {
  data.def_property_readonly(
      name,
      [list](const py::object& self) {
        return viewOf((self.cast<const CollisionData&>().*list)(), self);
      },
      text);
}

void addTracked(DataClass& data, const char* name,
                std::span<const TrackedContact> (CollisionData::*list)() const, const char* text) {
  data.def_property_readonly(
      name,
      [list](const CollisionData& self) {
        const auto contacts = (self.*list)();
        py::array records = newRecords<TrackedRecord>(contacts.size());
        std::transform(contacts.begin(), contacts.end(), recordsIn<TrackedRecord>(records).begin(),
                       [](const TrackedContact& c) {
                         return TrackedRecord{c.key,
                                              c.predecessor.value_or(ContactKey{}),
                                              c.predecessor.has_value(),
                                              c.age,
                                              c.userData,
                                              c.end};
                       });
        return records;
      },
      text);
}

/// A property with one unit normal for each contact of a list.
void addNormals(DataClass& data, const char* name,
                std::span<const Eigen::Vector3d> (CollisionData::*list)() const, const char* text) {
  data.def_property_readonly(
      name, [list](const CollisionData& self) { return copyOf((self.*list)()); }, text);
}

py::object stencils(const CollisionData& data, const py::object& firstA, const py::object& firstB) {
  const std::uint32_t a = elementIndex(firstA, "first_a"), b = elementIndex(firstB, "first_b");
  const CollisionData::Parts parts = data.parts();
  std::size_t count = 0;
  forEachMeshList(parts, [&](ContactKind, const auto& list) { count += list.size(); });
  auto ids = newArray<std::uint32_t>(count, 4);
  auto weights = newArray<double>(count, 4), normals = newArray<double>(count, 3),
       distances = newArray<double>(count);
  std::uint32_t* id = ids.mutable_data();
  double *weight = weights.mutable_data(), *normal = normals.mutable_data(),
         *distance = distances.mutable_data();
  const auto append = [&](ContactKind kind, const auto& contacts) {
    for (const auto& contact : contacts) {
      const Stencil s = stencil(contact);
      for (std::size_t i = 0; i < 4; ++i) {
        *id++ = s.vertices[i] + (sidesOf(kind)[i] == 0 ? a : b);
        *weight++ = s.weights[i];
      }
      for (int axis = 0; axis < 3; ++axis) *normal++ = contact.normal[axis];
      *distance++ = contact.distance;
    }
  };
  forEachMeshList(parts, append);
  return lookedUp<Stencil>("palpate", "Stencils")(ids, weights, normals, distances);
}

/// One side of a pair in the numbers of a solver: None, positions at rest, or SolverVertices.
struct Side {
  std::optional<Positions> now, before;
  SolverVertices vertices;

  Side(const py::handle& side, std::uint32_t first) {
    if (side.is_none()) return;
    if (!py::isinstance(side, lookedUp<SolverVertices>("palpate", "SolverVertices"))) {
      now.emplace(side, "positions");
      vertices = {first, now->span(), now->span()};
      return;
    }
    now.emplace(side.attr("now"), "now");
    vertices = {elementIndex(side.attr("first"), "first"), now->span(), now->span()};
    if (side.attr("before").is_none()) return;
    before.emplace(side.attr("before"), "before");
    vertices.before = before->span();
  }
  std::uint32_t end() const {
    return vertices.first + static_cast<std::uint32_t>(vertices.now.size());
  }
};

struct TwoSides {
  Side a, b;
  TwoSides(const py::handle& first, const py::handle& second)
      : a(first, 0), b(second, first.is(second) ? 0 : a.end()) {}
};

/// Rows, and one more than the last vertex of the solver that is known.
struct NumberedRows {
  std::vector<ConstraintRow> rows;
  std::size_t vertexCount = 0;
};

/// Without a and b: those of the positions of the step.
NumberedRows rowsOf(const CollisionData& data, const py::object& a, const py::object& b,
                    const py::object& motion, const py::object& firstA, const py::object& firstB) {
  NumberedRows result;
  if (a.is_none() && b.is_none() && motion.is_none()) {
    data.appendRows(result.rows, elementIndex(firstA, "first_a"), elementIndex(firstB, "first_b"));
    for (const ConstraintRow& row : result.rows)
      for (const std::uint32_t vertex : row.vertices)
        result.vertexCount = std::max(result.vertexCount, std::size_t{vertex} + 1);
  } else {
    const TwoSides sides(a, b);
    result.vertexCount = std::max(sides.a.end(), sides.b.end());
    appendRows(data, sides.a.vertices, sides.b.vertices, result.rows, motionOf(motion));
  }
  return result;
}

py::object sparseRows(const CollisionData& data, const py::object& a, const py::object& b,
                      const py::object& motion, const py::object& vertexCount,
                      const py::object& firstA, const py::object& firstB) {
  const auto [rows, known] = rowsOf(data, a, b, motion, firstA, firstB);
  const std::size_t columns =
      3 * (vertexCount.is_none() ? known : std::size_t{elementIndex(vertexCount, "vertex_count")});
  struct Entries {
    std::vector<std::uint32_t> rows, columns;
    std::vector<double> values;
  } entries;
  forEachEntry(
      rows,
      [](void* context, int row, int column, double value) {
        auto& all = *static_cast<Entries*>(context);
        all.rows.push_back(static_cast<std::uint32_t>(row));
        all.columns.push_back(static_cast<std::uint32_t>(column));
        all.values.push_back(value);
      },
      &entries);
  auto offsets = newArray<double>(rows.size());
  for (std::size_t i = 0; i < rows.size(); ++i) offsets.mutable_at(i) = rows[i].offset;
  const py::object matrix =
      py::module_::import("scipy.sparse")
          .attr("csr_matrix")(
              py::make_tuple(copyOf(entries.values),
                             py::make_tuple(copyOf(entries.rows), copyOf(entries.columns))),
              py::arg("shape") = py::make_tuple(rows.size(), columns));
  return lookedUp<ConstraintRow>("palpate", "Rows")(matrix, offsets);
}

py::array motions(const CollisionData& data, const py::object& a, const py::object& b) {
  const TwoSides sides(a.attr("vertices"), b.attr("vertices"));
  const Numbers radiiA(a.attr("radii"), "radii"), radiiB(b.attr("radii"), "radii");
  std::vector<ContactMotion> result;
  appendMotions(data, {sides.a.vertices, radiiA.span(), motionOf(a.attr("motion"))},
                {sides.b.vertices, radiiB.span(), motionOf(b.attr("motion"))}, result);
  return recordsOf(result);
}

py::tuple state(const CollisionData& data) {
  const CollisionData::Parts parts = data.parts();
  py::list items;
  const auto append = [&](ContactKind, const auto& list) { items.append(recordsOf(list)); };
  forEachMeshList(parts, append);
  items.append(recordsOf(parts.intersectingTriangles));
  forEachShapeList(parts, append);
  items.append(parts.earliestTimeOfImpact), items.append(parts.errorBound);
  items.append(parts.validity);
  return py::tuple(items);
}

std::shared_ptr<CollisionData> ofState(const py::tuple& state) {
  const auto vertexTriangle = structsIn<VertexTriangleContact>(state[0]);
  const auto triangleVertex = structsIn<VertexTriangleContact>(state[1]);
  const auto edgeEdge = structsIn<EdgeEdgeContact>(state[2]);
  const auto intersectingTriangles = structsIn<ElementPair>(state[3]);
  const auto shape = structsIn<ShapeContact>(state[4]);
  const auto shapeShape = structsIn<ShapeShapeContact>(state[5]);
  return std::make_shared<CollisionData>(CollisionData::Parts{
      vertexTriangle, triangleVertex, edgeEdge, intersectingTriangles, shape, shapeShape,
      state[6].cast<double>(), state[7].cast<double>(), state[8].cast<Validity>()});
}

bool equal(const CollisionData& a, const CollisionData& b) {
  const CollisionData::Parts ofA = a.parts(), ofB = b.parts();
  bool areEqual = std::ranges::equal(ofA.intersectingTriangles, ofB.intersectingTriangles);
  forEachContactList(ofA, [&](auto kind, const auto& list) {
    areEqual = areEqual && std::ranges::equal(list, contactList<kind()>(ofB));
  });
  return areEqual && a.earliestTimeOfImpact() == b.earliestTimeOfImpact() &&
         a.errorBound() == b.errorBound() && a.validity() == b.validity();
}

std::string describeData(const CollisionData& data) {
  std::string text = "<palpate.CollisionData:";
  const auto add = [&](std::size_t count, const char* name) {
    if (count > 0) text += " " + std::to_string(count) + " " + name + ",";
  };
  constexpr std::array kNames{"vertex-triangle", "triangle-vertex", "edge-edge", "shape",
                              "shape-shape"};
  const auto addList = [&](ContactKind kind, const auto& list) {
    add(list.size(), kNames[static_cast<std::size_t>(kind)]);
  };
  const CollisionData::Parts parts = data.parts();
  forEachMeshList(parts, addList);
  add(parts.intersectingTriangles.size(), "intersecting triangles");
  forEachShapeList(parts, addList);
  if (text.back() == ':') text += " no contacts,";
  return text + " by " + toString(data.validity().method) +
         (data.validity().trusted ? ", trusted>" : ", not trusted>");
}

}  // namespace

void addCollisionData(py::module_& module) {
  DataClass data(module, "CollisionData", R"(The contacts of one pair of geometries in one frame.

It is a copy that never changes. Lists of contacts are NumPy record arrays that cannot be written:
data.vertex_triangle["normal"] is an (n, 3) array, and so is data.vertex_triangle.normal of a
numpy.recarray view; each contact has its fields as attributes. Lists are sorted by ids.
Contacts obey one law: with the positions at the contact's time_of_impact, the weighted sum of the
positions of its stencil is (distance + radii) * normal. Lengths are in L.)");
  addList(data, "vertex_triangle", &CollisionData::vertexTriangle,
          R"(Vertices of the first geometry with triangles of the second, as a record array (n,).

vertex, triangle  indices; the triangle may be a segment or a point
vertices          (3,) the triangle's vertices; {p, q, q} of a segment, {p, p, p} of a point
weights           (3,) of these vertices at the closest point
normal            (3,), unit, from the triangle to the vertex
distance          L, at time_of_impact
time_of_impact    in [0, 1] of the step
feature           a TriangleFeature, as a number)");
  addList(data, "triangle_vertex", &CollisionData::triangleVertex,
          "Triangles of the first geometry with vertices of the second, as vertex_triangle.");
  addList(data, "edge_edge", &CollisionData::edgeEdge,
          R"(Edges of the first geometry with edges of the second, as a record array (n,).

edge_a, edge_b        (2,) vertex indices, lower first
weight_a, weight_b    closest point = p0 + weight * (p1 - p0)
normal                (3,), unit, from edge b to edge a
distance              L, at time_of_impact
time_of_impact        in [0, 1] of the step
feature_a, feature_b  EdgeFeature, as numbers)");
  addList(data, "intersecting_triangles", &CollisionData::intersectingTriangles,
          "Triangles a and b that intersect at the step's end, as a record array (n,).");
  addList(data, "shape", &CollisionData::shape,
          R"(Contacts with a shape, or by DISTANCE_FIELD or PROXY, as a record array (n,).

element         a ShapeElement, as a number
id              vertex or triangle; of an edge its lower vertex
vertices        (3,) vertex indices
weights         (3,) of these vertices at `point`
point           (3,), L, on the element
point_on_shape  (3,), L
normal          (3,), unit, out of the shape
distance        L; negative inside
time_of_impact  in [0, 1] of the step)");
  addList(data, "shape_shape", &CollisionData::shapeShape,
          R"(The contact of two shapes, as a record array (0,) or (1,).

point_a, point_b  (3,), L, on the surfaces
normal            (3,), unit, from shape b to shape a
distance          L; negative: how deep they overlap
time_of_impact    in [0, 1] of the step)");
  addTracked(data, "tracked_vertex_triangle", &CollisionData::trackedVertexTriangle,
             R"(With track_contacts one record for each contact of vertex_triangle; else empty.

key              kind, a ContactKind, and ids (4,): the two features
predecessor      the key of the contact of the last step from which it slid
has_predecessor  whether there is one
age              in steps; 0: it began in this one
user_data        OctreeBasedCD.set_user_data()
end              a ContactEnd, as a number

A pickled copy has none.)");
  addTracked(data, "tracked_triangle_vertex", &CollisionData::trackedTriangleVertex,
             "The same for triangle_vertex.");
  addTracked(data, "tracked_edge_edge", &CollisionData::trackedEdgeEdge, "The same for edge_edge.");
  addTracked(data, "tracked_shape", &CollisionData::trackedShape, "The same for shape.");
  addTracked(data, "tracked_shape_shape", &CollisionData::trackedShapeShape,
             "The same for shape_shape.");
  addTracked(data, "ended", &CollisionData::ended,
             "Contacts of the last step that ended, by key; `end` says why.");
  addList(data, "crossings", &CollisionData::crossings,
          R"(With report_crossings the passages within the step, as a record array (n,).

kind     a ContactKind, as a number
ids      (4,) as in a contact's key
time     in [0, 1] of the step
forward  whether the vertex passed to the side of the triangle's normal

A pickled copy has none.)");
  data.def(
      "tags",
      [](const CollisionData& self, const ContactKind kind) { return copyOf<2>(self.tags(kind)); },
      py::arg("kind"),
      R"(tags(kind) -> numpy.ndarray

OctreeBasedCD.set_tags(): (n, 2), the tags of both geometries' features for each contact of the list
of this ContactKind; vertices and edges have that of the lowest enabled element that holds them.
Empty if neither geometry has tags, and in a pickled copy.)");
  addNormals(data, "smooth_vertex_triangle", &CollisionData::smoothVertexTriangle,
             R"(With smooth_normals (n, 3) unit normals, one for each contact of vertex_triangle.

They are interpolated between the normals of the mesh's vertices, on the side of the contact's
normal. rows() and constraint_rows() use them. A pickled copy has none.)");
  addNormals(data, "smooth_triangle_vertex", &CollisionData::smoothTriangleVertex,
             "The same for triangle_vertex.");
  addNormals(data, "smooth_edge_edge", &CollisionData::smoothEdgeEdge, "The same for edge_edge.");
  addNormals(data, "smooth_shape", &CollisionData::smoothShape, "The same for shape.");
  addList(data, "remembered_sides", &CollisionData::rememberedSides,
          R"(With remember_sides the passages of earlier steps from which nothing has returned.

They are records as those of `crossings`, of the step's start, with time 0. A pickled copy has none.)");
  data.def_property_readonly("earliest_time_of_impact", &CollisionData::earliestTimeOfImpact,
                             "The least time of impact, in [0, 1]; infinity without contacts.")
      .def_property_readonly("error_bound", &CollisionData::errorBound,
                             "L: by how much distances may be off; 0 for exact methods.")
      .def_property_readonly(
          "validity", [](const CollisionData& self) { return self.validity(); },
          "A Validity: whether this answer can be trusted, and why not.")
      .def("hash", &CollisionData::hash,
           "hash() -> int\n\nOf all contacts; equal answers have equal hashes on every machine.")
      .def("stencils", &stencils, py::arg("first_a") = 0, py::arg("first_b") = 0,
           R"(stencils(first_a=0, first_b=0) -> Stencils

ids (n, 4), weights (n, 4), normals (n, 3) and distances (n,) of vertex_triangle, triangle_vertex
and edge_edge, one after another. The first id of a vertex-triangle contact is the vertex, with
weight 1; those of an edge-edge contact are p0, p1, q0, q1. first_a, first_b: added to the ids of
the first and the second geometry, such as the number of its first vertex in a solver.)")
      .def("rows", &sparseRows, py::arg("a") = py::none(), py::arg("b") = py::none(),
           py::arg("motion") = py::none(), py::arg("vertex_count") = py::none(),
           py::arg("first_a") = 0, py::arg("first_b") = 0,
           R"(rows(a=None, b=None, motion=None, vertex_count=None, first_a=0, first_b=0) -> Rows

A SciPy sparse Jacobian (n, 3 m) and offsets (n,): with stacked positions x of the solver, the gaps
are jacobian @ x - offsets, in L. Needs SciPy. Without a, b and motion the positions are those of
the detected step; pickled data has none.

a, b              SolverVertices of the two geometries; or positions (n, 3) at rest, those of b
                  after those of a; None for a shape
motion            RigidMotion of the pair's shape
vertex_count      m; None: as many as a and b have, or as the rows name
first_a, first_b  without a and b: the solver's numbers of the first vertices)")
      .def(
          "constraint_rows",
          [](const CollisionData& self, const py::object& a, const py::object& b,
             const py::object& motion, const py::object& firstA, const py::object& firstB) {
            return recordsOf(rowsOf(self, a, b, motion, firstA, firstB).rows);
          },
          py::arg("a") = py::none(), py::arg("b") = py::none(), py::arg("motion") = py::none(),
          py::arg("first_a") = 0, py::arg("first_b") = 0,
          R"(constraint_rows(a=None, b=None, motion=None, first_a=0, first_b=0) -> numpy.ndarray

The rows of rows() as records: vertices (4,), weights (4,), normal (3,), offset.)")
      .def("motions", &motions, py::arg("a"), py::arg("b"),
           R"(motions(a, b) -> numpy.ndarray

The place of each contact and how its sides slide along each other in the step, for friction:
records with point (3,), opposite (3,) and relative_displacement (3,), in L, in the order of
constraint_rows(). a, b: ContactSide.)")
      .def(
          "__eq__",
          [](const CollisionData& self, const py::object& other) -> py::object {
            if (!py::isinstance<CollisionData>(other))
              return py::reinterpret_borrow<py::object>(Py_NotImplemented);
            return py::bool_(equal(self, other.cast<const CollisionData&>()));
          },
          py::arg("other"))
      .def("__hash__", &CollisionData::hash)
      .def("__repr__", &describeData)
      .def(py::pickle(&state, &ofState));
}

}  // namespace palpate::python
