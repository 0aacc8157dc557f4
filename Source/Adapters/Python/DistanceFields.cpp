// Part of Python/Classes.h: distance fields and surface proxies.

#include "Python/Classes.h"
#include "Python/Collisions.h"

#include <palpate/DistanceField.h>
#ifdef PALPATE_HAS_SIMPLIFY
#include <palpate/Simplify.h>
#endif

namespace palpate::python {
namespace {

using Object = const py::object&;

DistanceField build(Object positions, Object triangles, double errorBound, double band,
                    std::size_t memoryLimit, int threads, Object progress) {
  const Positions p(positions, "positions");
  const Elements<3> t(triangles, "triangles");
  const DistanceFieldSettings settings{errorBound, band, memoryLimit, threads,
                                       progressOf(progress)};
  const py::gil_scoped_release release;
  return DistanceField::build({p.span(), t.span()}, settings);
}

/// One result for a point (3,), an array of them for points (n, 3).
template <class Number, class F>
py::object ofPoints(Object points, F&& f) {
  if (py::array::ensure(points).ndim() == 1)
    return py::cast(static_cast<Number>(f(position(points, "point"))));
  const Positions p(points, "points");
  auto result = newArray<Number>(p.size());
  Number* out = result.mutable_data();
  {
    const py::gil_scoped_release release;
    for (const Eigen::Vector3d& point : p.span()) *out++ = f(point);
  }
  return result;
}

py::object value(const DistanceField& self, Object points) {
  if (py::array::ensure(points).ndim() == 1)
    return py::float_(self.value(position(points, "point")));
  const Positions p(points, "points");
  auto result = newArray<double>(p.size());
  const std::span<double> out(result.mutable_data(), p.size());
  {
    const py::gil_scoped_release release;
    self.values(p.span(), out);
  }
  return result;
}

py::object gradient(const DistanceField& self, Object points) {
  if (py::array::ensure(points).ndim() == 1)
    return copyOf(self.gradient(position(points, "point")));
  const Positions p(points, "points");
  std::vector<Eigen::Vector3d> gradients(p.size());
  {
    const py::gil_scoped_release release;
    for (std::size_t i = 0; i < p.size(); ++i) gradients[i] = self.gradient(p.span()[i]);
  }
  return copyOf(gradients);
}

std::string describeField(const DistanceField& self) {
  return "<palpate.DistanceField: error bound " +
         py::repr(py::float_(self.errorBound())).cast<std::string>() + ", band " +
         py::repr(py::float_(self.band())).cast<std::string>() + ", " +
         std::to_string(self.cells()) + " cells, " + (self.isClosed() ? "closed>" : "open>");
}

py::object simplified(Object positions, Object triangles, double maxDistance, int threads,
                      Object progress) {
  const Positions p(positions, "positions");
  const Elements<3> t(triangles, "triangles");
#ifdef PALPATE_HAS_SIMPLIFY
  SimplifiedMesh mesh;
  {
    const SimplifySettings settings{maxDistance, threads, progressOf(progress)};
    const py::gil_scoped_release release;
    mesh = simplify({p.span(), t.span()}, settings);
  }
  return lookedUp<SimplifiedMesh>("palpate", "SimplifiedMesh")(
      copyOf(mesh.positions), copyOf<3>(mesh.triangles), mesh.distance, mesh.rounds);
#else
  static_cast<void>(maxDistance), static_cast<void>(threads), static_cast<void>(progress);
  throw Error(ErrorCode::NotAvailable, "This build of palpate has no simplify().");
#endif
}

}  // namespace

void addFields(py::module_& module) {
  py::class_<DistanceField>(module, "DistanceField",
                            R"(The signed distance from a mesh's surface, with a proven error bound.

Make it by DistanceField.build() or DistanceField.load(). It never changes. Points are (3,) or
(n, 3), L, in the mesh's frame; the results are those of one point, or (n,) arrays.)")
      .def_static(
          "build", &build, py::arg("positions"), py::arg("triangles"), py::kw_only(),
          py::arg("error_bound"), py::arg("band"),
          py::arg("memory_limit") = DistanceFieldSettings{}.memoryLimit, py::arg("threads") = 0,
          py::arg("progress") = py::none(),
          R"(build(positions, triangles, *, error_bound, band, memory_limit=2**31, threads=0, progress=None) -> DistanceField

positions     (n, 3), L
triangles     (m, 3) vertex indices
error_bound   L, positive: what value() may be off by, in the band
band          L, positive: the distance up to which the error bound holds
memory_limit  bytes of the build; 0: no limit
threads       0: one per core
progress      progress(fraction): called from time to time; returning False raises Error CANCELLED)")
      .def_property_readonly("is_closed", &DistanceField::isClosed,
                             "Whether the mesh was closed: all signs are reliable.")
      .def_property_readonly("error_bound", &DistanceField::errorBound, "L.")
      .def_property_readonly("band", &DistanceField::band, "L.")
      .def_property_readonly("bytes", &DistanceField::bytes, "Memory that the field holds.")
      .def_property_readonly("cells", &DistanceField::cells, "The number of cells.")
      .def("value", &value, py::arg("points"),
           "value(points) -> float | numpy.ndarray\n\nThe distance, L, negative inside.")
      .def(
          "values",
          [](const DistanceField& self, Object points) {
            const Positions p(points, "points");
            return value(self, points);
          },
          py::arg("points"),
          "values(points) -> numpy.ndarray\n\nvalue() of points (n, 3), as an array (n,).")
      .def(
          "sign_is_reliable",
          [](const DistanceField& self, Object points) {
            return ofPoints<bool>(
                points, [&](const Eigen::Vector3d& point) { return self.signIsReliable(point); });
          },
          py::arg("points"),
          "sign_is_reliable(points) -> bool | numpy.ndarray\n\nWhether value() has a certain sign.")
      .def("gradient", &gradient, py::arg("points"),
           "gradient(points) -> numpy.ndarray\n\nThe gradient of value(), (3,) or (n, 3).")
      .def("save", &DistanceField::save, py::arg("path"), py::call_guard<py::gil_scoped_release>(),
           "save(path) -> None\n\nWrites the field to a file, completely or not at all.")
      .def_static("load", &DistanceField::load, py::arg("path"),
                  py::call_guard<py::gil_scoped_release>(),
                  "load(path) -> DistanceField\n\nReads a file of save().")
      .def("__repr__", &describeField);
  module.def(
      "simplify", &simplified, py::arg("positions"), py::arg("triangles"), py::arg("max_distance"),
      py::arg("threads") = 0, py::arg("progress") = py::none(),
      R"(simplify(positions, triangles, max_distance, threads=0, progress=None) -> SimplifiedMesh

Simplifies a closed mesh to one that encloses it and is within max_distance (L) of it, both proven.
progress(fraction) may return False to raise Error CANCELLED.)");
}

}  // namespace palpate::python
