// Part of Python/Classes.h: step guards.

#include "Python/Collisions.h"
#include "Python/Records.h"

#include <palpate/StepGuard.h>

namespace palpate::python {
namespace {

using Object = const py::object&;

/// The object behind palpate.StepGuard. It keeps the OctreeBasedCD alive.
struct Guard {
  std::shared_ptr<Collisions> owner;
  StepGuard guard;

  explicit Guard(const std::shared_ptr<Collisions>& collisions)
      : owner(collisions),
        guard(collisions->change([](OctreeBasedCD& d) { return StepGuard(d); })) {}
};

/// Rows of (geometry, vertex), or pairs in which the vertex None means the whole geometry.
std::vector<GuardedVertex> guardedVertices(Object vertices) {
  std::vector<GuardedVertex> result;
  for (const py::handle vertex : vertices) {
    const auto pair = py::reinterpret_borrow<py::sequence>(vertex);
    if (py::len(pair) != 2) throw py::type_error("Guarded vertices are pairs (geometry, vertex).");
    const py::object index = pair[1];
    result.push_back(
        {geometryId(pair[0]), index.is_none() ? kNoElement : elementIndex(index, "vertex")});
  }
  return result;
}

}  // namespace

void addStepGuard(py::module_& module) {
  py::class_<Guard>(module, "StepGuard",
                    R"(Prevents geometries from passing through each other at the end of a step.

StepGuard(collisions): call hold() after the solver's last correction and before advance(). It
shortens the steps of vertices and placed bodies until nothing touches within the step.)")
      .def(py::init([](const std::shared_ptr<Collisions>& collisions) {
             return std::make_unique<Guard>(collisions);
           }),
           py::arg("collisions"))
      .def(
          "set_guarded",
          [](Guard& self, Object first, Object second, bool guarded) {
            const GeometryId a = geometryId(first), b = geometryId(second);
            self.owner->change([&](OctreeBasedCD&) { self.guard.setGuarded(a, b, guarded); });
          },
          py::arg("a"), py::arg("b"), py::arg("guarded"),
          "set_guarded(a, b, guarded) -> None\n\nWhether features of a pair must not touch.")
      .def(
          "add_rigid_group",
          [](Guard& self, Object vertices) {
            const std::vector<GuardedVertex> group = guardedVertices(vertices);
            self.owner->change([&](OctreeBasedCD&) { self.guard.addRigidGroup(group); });
          },
          py::arg("vertices"),
          R"(add_rigid_group(vertices) -> None

These vertices make one fraction of their steps: (n, 2) rows of (geometry, vertex), or pairs in
which the vertex None means the whole geometry.)")
      .def(
          "set_fixed_vertices",
          [](Guard& self, Object geometry, Object vertices) {
            const GeometryId id = geometryId(geometry);
            if (vertices.is_none()) {
              const std::array<std::uint32_t, 1> all{kNoElement};
              return self.owner->change(
                  [&](OctreeBasedCD&) { self.guard.setFixedVertices(id, all); });
            }
            const Indices indices(vertices, 1, "vertices");
            self.owner->change(
                [&](OctreeBasedCD&) { self.guard.setFixedVertices(id, indices.all()); });
          },
          py::arg("geometry"), py::arg("vertices"),
          R"(set_fixed_vertices(geometry, vertices) -> None

These vertices, (n,), always make their whole step, and no other ones of the geometry. None: all, or
a shape.)")
      .def(
          "hold",
          [](Guard& self) {
            return self.owner->work([&](OctreeBasedCD&) { return self.guard.hold(); });
          },
          R"(hold() -> int

Shortens steps and returns the number of held() vertices. Sets positions and transforms now. Raises
Error IMPACT_REMAINS if features touch and cannot be shortened.)")
      .def(
          "held",
          [](Guard& self) {
            return self.owner->read([&](OctreeBasedCD&) { return recordsOf(self.guard.held()); });
          },
          R"(held() -> numpy.ndarray

What the last hold() shortened, as records: geometry, vertex (NO_ELEMENT: a placed geometry),
fraction of its step.)")
      .def_property_readonly(
          "rounds",
          [](Guard& self) {
            return self.owner->read([&](OctreeBasedCD&) { return self.guard.rounds(); });
          },
          "The number of detections in the last hold().")
      .def("__repr__", [](const Guard&) { return "<palpate.StepGuard>"; });
}

}  // namespace palpate::python
