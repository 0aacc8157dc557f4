// Part of Python/Classes.h: functions on positions.

#include "Python/Classes.h"
#include "Python/Collisions.h"
#include "Python/Records.h"

#include <palpate/ArrayAdapter.h>
#include <palpate/FeaturePairs.h>
#include <palpate/Meshes.h>

namespace palpate::python {
namespace {

using Object = const py::object&;

/// Arguments of a function of positions: each is one position (3,), or many (n, 3). Single ones
/// count for all rows.
template <std::size_t N>
class Rows {
 public:
  explicit Rows(const py::args& arguments) {
    if (arguments.size() != N)
      throw py::type_error("The function takes " + std::to_string(N) + " positions, not " +
                           std::to_string(arguments.size()) + ".");
    const py::object atLeast2d = py::module_::import("numpy").attr("atleast_2d");
    for (const py::handle argument : arguments) {
      py::array array = py::array::ensure(argument);
      if (!array) throw py::error_already_set();
      m_single = m_single && array.ndim() == 1;
      m_columns.emplace_back(atLeast2d(array), "positions");
      m_rows = std::max(m_rows, m_columns.back().size());
    }
    for (const Positions& column : m_columns)
      if (column.size() != m_rows && column.size() != 1)
        throw Error(ErrorCode::WrongPositionCount, "There are " + std::to_string(column.size()) +
                                                       " positions in one array and " +
                                                       std::to_string(m_rows) + " in another.");
  }
  bool single() const { return m_single; }
  std::size_t size() const { return m_rows; }
  /// f(the positions of a row)
  template <class F>
  auto call(std::size_t row, F&& f) const {
    return [&]<std::size_t... I>(std::index_sequence<I...>) {
      return f(m_columns[I].span()[m_columns[I].size() == 1 ? 0 : row]...);
    }
    (std::make_index_sequence<N>());
  }

 private:
  std::vector<Positions> m_columns;
  std::size_t m_rows = 1;
  bool m_single = true;
};

/// A function that gives a struct for each row.
template <std::size_t N, class Struct, class F>
py::object records(const py::args& arguments, F f) {
  const Rows<N> rows(arguments);
  py::array result = newRecords<Struct>(rows.size());
  const std::span<Struct> out = recordsIn<Struct>(result);
  {
    const py::gil_scoped_release release;
    for (std::size_t i = 0; i < rows.size(); ++i) out[i] = rows.call(i, f);
  }
  if (rows.single()) return result[py::int_(0)];
  return result;
}

/// A function that gives a number for each row.
template <std::size_t N, class Number, class F>
py::object numbers(const py::args& arguments, F f) {
  const Rows<N> rows(arguments);
  auto result = newArray<Number>(rows.size());
  Number* out = result.mutable_data();
  {
    const py::gil_scoped_release release;
    for (std::size_t i = 0; i < rows.size(); ++i) out[i] = rows.call(i, f);
  }
  if (rows.single()) return py::cast(*out);
  return result;
}

/// The time of an impact for each row; NaN without one, of single positions None.
template <class F>
py::object times(const py::args& arguments, double minimumDistance, double timeTolerance, F f) {
  const TimeOfImpactSettings settings{minimumDistance, timeTolerance};
  py::object result = numbers<8, double>(arguments, [&](const auto&... positions) {
    return f(positions..., settings).value_or(std::numeric_limits<double>::quiet_NaN());
  });
  if (py::isinstance<py::float_>(result) && std::isnan(result.cast<double>())) return py::none();
  return result;
}

py::object welded(Object positions, Object triangles, double distance) {
  const Positions p(positions, "positions");
  const Elements<3> t(triangles, "triangles");
  Welded result;
  {
    const py::gil_scoped_release release;
    result = weld(p.span(), t.span(), distance);
  }
  return lookedUp<Welded>("palpate", "Welded")(
      copyOf(result.positions), copyOf<3>(result.triangles), copyOf(result.vertexOf));
}

py::object meshDefects(Object triangles, Object positions) {
  const Elements<3> t(triangles, "triangles");
  MeshDefects found;
  if (positions.is_none()) {
    const py::gil_scoped_release release;
    found = findMeshDefects(t.span());
  } else {
    const Positions p(positions, "positions");
    const py::gil_scoped_release release;
    found = findMeshDefects(TriangleMeshView{p.span(), t.span()});
  }
  return lookedUp<MeshDefects>("palpate", "MeshDefects")(
      copyOf<2>(found.open), copyOf<2>(found.flipped), copyOf<2>(found.shared), found.unwelded,
      found.insideOut, copyOf(found.overlapping));
}

std::shared_ptr<CollisionData> detect(Object positionsA, Object trianglesA, Object positionsB,
                                      Object trianglesB, Object settings,
                                      const py::kwargs& keywords) {
  const Positions a(positionsA, "positions_a"), b(positionsB, "positions_b");
  const Elements<3> ofA(trianglesA, "triangles_a"), ofB(trianglesB, "triangles_b");
  const auto value = settingsOf<PairSettings>(settings, keywords);
  const py::gil_scoped_release release;
  return std::make_shared<CollisionData>(
      detectCollision({a.span(), ofA.span()}, {b.span(), ofB.span()}, value));
}

/// (2, 3) tangents of one normal, or (n, 2, 3) of many.
py::object tangents(Object normals, Object previousNormalTangents) {
  const py::object atLeast2d = py::module_::import("numpy").attr("atleast_2d");
  const bool single = py::array::ensure(normals).ndim() == 1;
  const Positions n(atLeast2d(normals), "normals");
  std::vector<Eigen::Vector3d> result;
  if (previousNormalTangents.is_none()) {
    for (const Eigen::Vector3d& normal : n.span())
      for (const Eigen::Vector3d& tangent : tangentsOf(normal)) result.push_back(tangent);
  } else {
    const Positions previous(previousNormalTangents.attr("reshape")(-1, 3), "previous");
    if (previous.size() != 2 * n.size())
      throw Error(ErrorCode::WrongPositionCount, "There must be two previous tangents a normal.");
    for (std::size_t i = 0; i < n.size(); ++i)
      for (const Eigen::Vector3d& tangent :
           tangentsOf(n.span()[i], {previous.span()[2 * i], previous.span()[2 * i + 1]}))
        result.push_back(tangent);
  }
  const py::array_t<double> rows = copyOf(result);
  return single ? py::object(rows) : rows.attr("reshape")(-1, 2, 3);
}

}  // namespace

void addFunctions(py::module_& module) {
  module.def("weld", &welded, py::arg("positions"), py::arg("triangles"), py::arg("distance") = 0.0,
             R"(weld(positions, triangles, distance=0.0) -> Welded

Joins vertices at equal positions, or at most `distance` (L) apart, as those of an STL file.)");
  module.def("find_mesh_defects", &meshDefects, py::arg("triangles"),
             py::arg("positions") = py::none(),
             R"(find_mesh_defects(triangles, positions=None) -> MeshDefects

The edges because of which triangles (m, 3) have no inside; with positions (n, 3) also what they
show.)");
  module.def(
      "triangles_of_quads",
      [](Object quads) {
        const Elements<4> q(quads, "quads");
        return copyOf<3>(trianglesOfQuads(q.span()));
      },
      py::arg("quads"),
      R"(triangles_of_quads(quads) -> numpy.ndarray

(2 n, 3) triangles (a, b, c) and (a, c, d) of quads (n, 4).)");
  module.def(
      "detect_collision", &detect, py::arg("positions_a"), py::arg("triangles_a"),
      py::arg("positions_b"), py::arg("triangles_b"), py::arg("settings") = py::none(),
      R"(detect_collision(positions_a, triangles_a, positions_b, triangles_b, settings=None, **keywords) -> CollisionData

The contacts of two triangle meshes in one call, without a step. Keywords are those of PairSettings.)");
  module.def(
      "vertex_triangle_distance",
      [](const py::args& a) {
        return records<4, VertexTriangleDistance>(a, &vertexTriangleDistance);
      },
      R"(vertex_triangle_distance(p, a, b, c) -> numpy.record | numpy.ndarray

The point of the triangle a b c that is closest to p: weights (3,), difference (3,), normal (3,),
distance (L), feature, exact. Positions are (3,), or (n, 3) for records (n,).)");
  module.def(
      "edge_edge_distance",
      [](const py::args& a) { return records<4, EdgeEdgeDistance>(a, &edgeEdgeDistance); },
      R"(edge_edge_distance(p0, p1, q0, q1) -> numpy.record | numpy.ndarray

The closest points p0 + weight_a (p1 - p0) and q0 + weight_b (q1 - q0) of two edges, with difference
(3,), normal (3,), distance (L), feature_a, feature_b, parallel, exact. Positions as above.)");
  module.def(
      "triangles_intersect",
      [](const py::args& a) { return numbers<6, bool>(a, &trianglesIntersect); },
      R"(triangles_intersect(a0, a1, a2, b0, b1, b2) -> bool | numpy.ndarray

Whether two triangles have a common point, decided exactly. Positions are (3,), or (n, 3) for (n,)
bool.)");
  module.def(
      "vertex_triangle_time_of_impact",
      [](const py::args& a, double distance, double tolerance) {
        return times(a, distance, tolerance, &vertexTriangleTimeOfImpact);
      },
      py::kw_only(), py::arg("minimum_distance") = 0.0, py::arg("time_tolerance") = 1e-6,
      R"(vertex_triangle_time_of_impact(v_before, a_before, b_before, c_before, v_now, a_now, b_now, c_now, *, minimum_distance=0.0, time_tolerance=1e-6) -> float | None | numpy.ndarray

The time in [0, 1] at which a moving vertex first touches a moving triangle; None without an impact.
Positions are (3,), or (n, 3) for (n,) times, NaN without an impact. minimum_distance: L.)");
  module.def(
      "edge_edge_time_of_impact",
      [](const py::args& a, double distance, double tolerance) {
        return times(a, distance, tolerance, &edgeEdgeTimeOfImpact);
      },
      py::kw_only(), py::arg("minimum_distance") = 0.0, py::arg("time_tolerance") = 1e-6,
      R"(edge_edge_time_of_impact(p0_before, p1_before, q0_before, q1_before, p0_now, p1_now, q0_now, q1_now, *, minimum_distance=0.0, time_tolerance=1e-6) -> float | None | numpy.ndarray

The same for two moving edges.)");
  module.def("tangents_of", &tangents, py::arg("normals"), py::arg("previous") = py::none(),
             R"(tangents_of(normals, previous=None) -> numpy.ndarray

Two unit vectors perpendicular to a unit normal: (2, 3), or (n, 2, 3) for normals (n, 3). previous:
the tangents of an earlier frame, which these continue.)");
}

}  // namespace palpate::python
