// Part of Python/Classes.h: snapshots.

#include "Python/Classes.h"
#include "Python/Collisions.h"

#include <palpate/Snapshot.h>

namespace palpate::python {
namespace {

using Object = const py::object&;

/// The object behind palpate.Snapshot.
struct Published {
  std::shared_ptr<const Snapshot> snapshot;
};

/// An array that shows positions of a snapshot, which never change, and keeps it alive.
py::array view(const py::object& self, std::span<const Eigen::Vector3d> positions) {
  py::array_t<double> array(std::vector<py::ssize_t>{static_cast<py::ssize_t>(positions.size()), 3},
                            reinterpret_cast<const double*>(positions.data()), self);
  protect(array);
  return array;
}

}  // namespace

void addSnapshots(py::module_& module, CollisionsClass& collisions) {
  py::class_<Published>(module, "Snapshot", R"(The geometries as they were at publish().

It never changes, and other threads may query it while the simulation computes the next steps. It
outlives the OctreeBasedCD. Arrays of positions show its memory without a copy, keep it alive and
cannot be written.)")
      .def(
          "queries",
          [](const Published& self) {
            return Queries{self.snapshot->queries(), nullptr, self.snapshot};
          },
          "queries() -> SpatialQueries\n\nQueries at the positions of publish().")
      .def_property_readonly(
          "number", [](const Published& self) { return self.snapshot->number(); },
          "Counts the publications, from 1.")
      .def_property_readonly(
          "time", [](const Published& self) { return self.snapshot->time(); },
          "The time that publish() received.")
      .def(
          "has",
          [](const Published& self, Object geometry) {
            try {
              return self.snapshot->has(geometryId(geometry));
            } catch (const Error&) {
              return false;  // no 32-bit id
            }
          },
          py::arg("geometry"), "has(geometry) -> bool\n\nWhether it has the geometry.")
      .def(
          "positions",
          [](const py::object& self, Object geometry) {
            const auto& snapshot = *self.cast<const Published&>().snapshot;
            return view(self, snapshot.positions(geometryId(geometry)));
          },
          py::arg("geometry"),
          "positions(geometry) -> numpy.ndarray\n\n(n, 3), L, at the step's end, not writeable.")
      .def(
          "positions_before",
          [](const py::object& self, Object geometry) {
            const auto& snapshot = *self.cast<const Published&>().snapshot;
            return view(self, snapshot.positionsBefore(geometryId(geometry)));
          },
          py::arg("geometry"), "positions_before(geometry) -> numpy.ndarray\n\nAt its start.")
      .def(
          "tags",
          [](const Published& self, Object geometry) {
            return copyOf(self.snapshot->tags(geometryId(geometry)));
          },
          py::arg("geometry"), "tags(geometry) -> numpy.ndarray\n\nOctreeBasedCD.tags().")
      .def(
          "motion",
          [](const Published& self, Object geometry) {
            return toPython(self.snapshot->motion(geometryId(geometry)));
          },
          py::arg("geometry"),
          "motion(geometry) -> RigidMotion\n\nThe poses at both ends of the step.")
      .def(
          "position",
          [](const Published& self, Object geometry, Object vertex, double time) {
            return copyOf(self.snapshot->position(geometryId(geometry),
                                                  elementIndex(vertex, "vertex"), time));
          },
          py::arg("geometry"), py::arg("vertex"), py::arg("time") = 1.0,
          R"(position(geometry, vertex, time=1.0) -> numpy.ndarray

(3,), L, in the world: a vertex on the line of its step; 0 is the step's start, 1 its end.)")
      .def("__repr__", [](const Published& self) {
        return "<palpate.Snapshot " + std::to_string(self.snapshot->number()) + " at time " +
               py::repr(py::float_(self.snapshot->time())).cast<std::string>() + ">";
      });
  collisions
      .def(
          "queries",
          [](const std::shared_ptr<Collisions>& self) {
            return Queries{self->work([](OctreeBasedCD& d) { return d.queries(); }), self, nullptr};
          },
          "queries() -> SpatialQueries\n\nQueries at the positions now. Updates octrees if needed.")
      .def(
          "publish",
          [](Collisions& self, double time) {
            self.work([&](OctreeBasedCD& d) { d.publish(time); });
          },
          py::arg("time") = 0.0,
          R"(publish(time=0.0) -> None

Makes the state now the latest snapshot. time: yours, of any unit.)")
      .def(
          "latest_snapshot",
          [](const Collisions& self) -> std::optional<Published> {
            if (auto snapshot = self.detection.latestSnapshot())
              return Published{std::move(snapshot)};
            return {};
          },
          R"(latest_snapshot() -> Snapshot | None

The last state that was published. Safe from any thread at any time.)");
}

}  // namespace palpate::python
