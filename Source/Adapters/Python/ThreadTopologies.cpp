// Part of Python/Classes.h: stitches and knots.

#include "Python/Collisions.h"
#include "Python/Records.h"

#include <palpate/ThreadTopology.h>

namespace palpate::python {
namespace {

using Object = const py::object&;

/// The object behind palpate.ThreadTopology. It keeps the OctreeBasedCD alive.
struct Topology {
  std::shared_ptr<Collisions> owner;
  ThreadTopology topology;

  explicit Topology(const std::shared_ptr<Collisions>& collisions)
      : owner(collisions),
        topology(collisions->change([](OctreeBasedCD& d) { return ThreadTopology(d); })) {}
  /// f(topology), for a call that reads.
  template <class F>
  auto read(F&& f) const {
    return owner->read([&](OctreeBasedCD&) { return f(topology); });
  }
};

/// A pair (geometry, vertices).
VertexPath pathOf(Object path) {
  const auto pair = py::reinterpret_borrow<py::sequence>(path);
  if (!PySequence_Check(path.ptr()) || py::len(pair) != 2)
    throw py::type_error("A path is a pair (geometry, vertices).");
  const Indices vertices(pair[1], 1, "vertices");
  return {geometryId(pair[0]), {vertices.all().begin(), vertices.all().end()}};
}

using Add = std::size_t (ThreadTopology::*)(const VertexPath&, const VertexPath&);
auto adds(Add add) {
  return [add](Topology& self, Object first, Object second) {
    const VertexPath a = pathOf(first), b = pathOf(second);
    return self.owner->change([&](OctreeBasedCD&) { return (self.topology.*add)(a, b); });
  };
}

}  // namespace

void addThreadTopology(py::module_& module) {
  py::class_<Topology>(module, "ThreadTopology",
                       R"(How often threads pass through loops and each other.

ThreadTopology(collisions): call update() once the positions of a step are final, before advance().
A path is a pair (geometry, vertices).)")
      .def(py::init([](const std::shared_ptr<Collisions>& collisions) {
             return std::make_unique<Topology>(collisions);
           }),
           py::arg("collisions"))
      .def("add", adds(&ThreadTopology::add), py::arg("thread"), py::arg("loop"),
           R"(add(thread, loop) -> int

Watches how often a thread passes through a loop, a closed polygon. Returns the index of its
count.)")
      .def("add_parts", adds(&ThreadTopology::addParts), py::arg("first"), py::arg("second"),
           R"(add_parts(first, second) -> int

Watches how often edges of two parts of threads pass through each other. Returns the index of its
count.)")
      .def(
          "update",
          [](Topology& self) { self.owner->work([&](OctreeBasedCD&) { self.topology.update(); }); },
          R"(update() -> None

Looks at the present step. A further call in the same step replaces what the last one found.)")
      .def(
          "count",
          [](const Topology& self, std::size_t index) {
            return self.read([&](const ThreadTopology& t) { return t.count(index); });
          },
          py::arg("index"), "count(index) -> int\n\nAfter the last update(), at first of add().")
      .def(
          "is_lost",
          [](const Topology& self, std::size_t index) {
            return self.read([&](const ThreadTopology& t) { return t.isLost(index); });
          },
          py::arg("index"),
          "is_lost(index) -> bool\n\nWhether there was an event by CUT or DISABLED.")
      .def(
          "events",
          [](const Topology& self) {
            return self.read([](const ThreadTopology& t) { return recordsOf(t.events()); });
          },
          R"(events() -> numpy.ndarray

All changes of counts since the last clear(), as records: index, step, cause (a ThreadEventCause, as
a number), change, thread (2,) and loop (2,): vertices or NO_ELEMENT, time in [0, 1] of the step.)")
      .def(
          "clear",
          [](Topology& self) {
            self.owner->change([&](OctreeBasedCD&) { self.topology.clear(); });
          },
          "clear() -> None\n\nForgets the events of earlier updates.")
      .def(
          "save",
          [](const Topology& self) {
            return bytesOf(self.read([](const ThreadTopology& t) { return t.save(); }));
          },
          R"(save() -> bytes

The counts and events, beside the state of the collisions. Restore both.)")
      .def(
          "restore",
          [](Topology& self, const py::bytes& state) {
            const auto bytes = bytesIn(state);
            self.owner->change([&](OctreeBasedCD&) { self.topology.restore(bytes); });
          },
          py::arg("state"), R"(restore(state) -> None

Raises Error for other or changed bytes.)")
      .def("__repr__", [](const Topology&) { return "<palpate.ThreadTopology>"; });
}

}  // namespace palpate::python
