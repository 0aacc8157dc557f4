// Part of Python/Classes.h: problems, captures and audits.

#include "Python/Classes.h"
#include "Python/Collisions.h"
#include "Python/Records.h"

#include <palpate/Capture.h>

namespace palpate::python {
namespace {

using Geometry = CollisionProblem::Geometry;

/// A geometry or a pair of a problem, which it keeps alive.
template <class Part>
struct PartOf {
  std::shared_ptr<const CollisionProblem> problem;
  const Part* part;
};
template <class Part>
py::tuple partsOf(const std::shared_ptr<CollisionProblem>& problem,
                  const std::vector<Part>& parts) {
  py::tuple result(parts.size());
  for (std::size_t i = 0; i < parts.size(); ++i)
    result[i] = py::cast(PartOf<Part>{problem, &parts[i]});
  return result;
}

/// A property of a part, by a function of the C++ struct.
template <class Part, class F>
void addProperty(py::class_<PartOf<Part>>& part, const char* name, const char* text, F f) {
  part.def_property_readonly(
      name, [f](const PartOf<Part>& self) { return f(*self.part); }, text);
}

py::object contactOf(const AuditFailure::Contact& contact) {
  return std::visit(
      []<class T>(const T& alternative) -> py::object {
        if constexpr (std::is_same_v<T, std::monostate>)
          return py::none();
        else
          return recordOf(alternative);
      },
      contact);
}

py::list auditFailures(Collisions& self) {
  return self.read([](OctreeBasedCD& d) {
    py::list failures;
    for (const AuditFailure& f : d.auditFailures())
      failures.append(lookedUp<AuditFailure>("palpate", "AuditFailure")(
          static_cast<std::uint32_t>(f.a), static_cast<std::uint32_t>(f.b), f.frame, f.fault,
          f.list, contactOf(f.expected), contactOf(f.found), f.file, f.fileError));
    return failures;
  });
}

/// The library's failure that a Python one was made from, by its index among those of the frame.
void captureTo(Collisions& self, const std::filesystem::path& path, const py::object& failure) {
  if (failure.is_none()) return self.read([&](OctreeBasedCD& d) { capture(d, path); });
  AuditFailure wanted{};
  wanted.a = geometryId(failure.attr("a"));
  wanted.b = geometryId(failure.attr("b"));
  wanted.frame = failure.attr("frame").cast<std::uint64_t>();
  self.read([&](OctreeBasedCD& d) { capture(d, wanted, path); });
}

}  // namespace

void addCapture(py::module_& module, CollisionsClass& collisions) {
  py::class_<CollisionProblem, std::shared_ptr<CollisionProblem>> problem(
      module, "CollisionProblem", R"(Everything on which the answers of one frame depend.

Get it from OctreeBasedCD.problem() or read_capture(). set_up() makes an OctreeBasedCD from it. It
never changes, and its properties are copies.)");
  problem
      .def_property_readonly(
          "settings", [](const CollisionProblem& self) { return self.settings; },
          "Settings, without an executor.")
      .def_property_readonly(
          "geometries",
          [](const std::shared_ptr<CollisionProblem>& self) {
            return partsOf(self, self->geometries);
          },
          "A tuple of ProblemGeometry.")
      .def_property_readonly(
          "pairs",
          [](const std::shared_ptr<CollisionProblem>& self) { return partsOf(self, self->pairs); },
          "A tuple of ProblemPair, in the order in which they were added.")
      .def("__repr__", [](const CollisionProblem& self) {
        return "<palpate.CollisionProblem of " + std::to_string(self.geometries.size()) +
               " geometries and " + std::to_string(self.pairs.size()) + " pairs>";
      });

  py::class_<PartOf<Geometry>> geometry(module, "ProblemGeometry",
                                        "A geometry of a CollisionProblem.");
  addProperty(geometry, "id", "The id in the original OctreeBasedCD.",
              [](const Geometry& g) { return static_cast<std::uint32_t>(g.id); });
  addProperty(geometry, "type", "A GeometryType.", [](const Geometry& g) { return g.type; });
  addProperty(geometry, "before", "(n, 3), L: positions at the step's start.",
              [](const Geometry& g) { return copyOf(g.before); });
  addProperty(geometry, "now", "(n, 3), L: positions at the step's end.",
              [](const Geometry& g) { return copyOf(g.now); });
  addProperty(geometry, "triangles", "(m, 3); the segment {p, q} is {p, q, q}.",
              [](const Geometry& g) { return copyOf<3>(g.triangles); });
  addProperty(geometry, "tetrahedra", "(m, 4); empty: none.",
              [](const Geometry& g) { return copyOf<4>(g.tetrahedra); });
  addProperty(geometry, "radii", "L: none, one for all vertices, or one per vertex.",
              [](const Geometry& g) { return copyOf(g.radii); });
  addProperty(geometry, "rest", "(n, 3), L: positions at rest; empty: now.",
              [](const Geometry& g) { return copyOf(g.rest); });
  addProperty(geometry, "filter", "A CollisionFilter.", [](const Geometry& g) { return g.filter; });
  addProperty(geometry, "disabled", "Disabled elements.",
              [](const Geometry& g) { return copyOf(g.disabled); });
  addProperty(geometry, "removed", "Elements that cuts removed, which are in `triangles`.",
              [](const Geometry& g) { return copyOf(g.removed); });
  addProperty(geometry, "removed_tetrahedra", "The same in `tetrahedra`.",
              [](const Geometry& g) { return copyOf(g.removedTetrahedra); });
  addProperty(geometry, "tags", "OctreeBasedCD.tags().",
              [](const Geometry& g) { return copyOf(g.tags); });
  addProperty(geometry, "analytical", "The shape, or None.", [](const Geometry& g) -> py::object {
    return g.analytical ? toPython(*g.analytical) : py::none();
  });
  addProperty(geometry, "motion", "A RigidMotion: the poses at both ends of the step.",
              [](const Geometry& g) { return toPython(g.motion); });
  addProperty(geometry, "field", "The DistanceField, or None.",
              [](const Geometry& g) -> std::optional<DistanceField> {
                if (g.field) return *g.field;
                return {};
              });
  addProperty(geometry, "proxy", "SurfaceProxySettings, or None.",
              [](const Geometry& g) { return g.proxy; });
  addProperty(geometry, "name", "The name.", [](const Geometry& g) { return g.name; });
  geometry.def("__repr__", [](const PartOf<Geometry>& self) {
    return "<palpate.ProblemGeometry " + std::to_string(static_cast<std::uint32_t>(self.part->id)) +
           ": " + toString(self.part->type) + ", " + std::to_string(self.part->now.size()) +
           " vertices>";
  });

  using Pair = CollisionProblem::Pair;
  py::class_<PartOf<Pair>> pair(module, "ProblemPair", "A pair of a CollisionProblem.");
  addProperty(pair, "a", "Index in `geometries`.", [](const Pair& p) { return p.a; });
  addProperty(pair, "b", "Index in `geometries`.", [](const Pair& p) { return p.b; });
  addProperty(pair, "settings", "PairSettings.", [](const Pair& p) { return p.settings; });
  addProperty(pair, "method", "The Method that answered.", [](const Pair& p) { return p.method; });
  addProperty(pair, "predicate", "Whether the pair has a predicate, which a problem cannot hold.",
              [](const Pair& p) { return p.predicate; });
  addProperty(pair, "sides", "With remember_sides the records of CollisionData.remembered_sides.",
              [](const Pair& p) { return recordsOf(std::span<const Crossing>(p.sides)); });
  pair.def("__repr__", [](const PartOf<Pair>& self) {
    return "<palpate.ProblemPair (" + std::to_string(self.part->a) + ", " +
           std::to_string(self.part->b) + "): " + toString(self.part->settings.method) + ">";
  });

  collisions
      .def("audit_failures", &auditFailures,
           R"(audit_failures() -> list[AuditFailure]

Differences between the last frame and brute force, if Settings.audit asks for them.)")
      .def(
          "problem",
          [](Collisions& self) {
            return self.read(
                [](OctreeBasedCD& d) { return std::make_shared<CollisionProblem>(d.problem()); });
          },
          "problem() -> CollisionProblem\n\nA copy of everything on which the frame depends.");
  module.def("capture", &captureTo, py::arg("collisions"), py::arg("path"),
             py::arg("failure") = py::none(),
             R"(capture(collisions, path, failure=None) -> None

Writes the problem of the last frame to a text file, which replays it to the last bit. Call it after
a frame and before positions change. failure: an AuditFailure, whose pair alone is written.)");
  module.def(
      "write_capture",
      [](const CollisionProblem& self, const std::filesystem::path& path) {
        const py::gil_scoped_release release;
        writeCapture(self, path);
      },
      py::arg("problem"), py::arg("path"),
      "write_capture(problem, path) -> None\n\nWrites a problem to a file.");
  module.def(
      "read_capture",
      [](const std::filesystem::path& path) {
        const py::gil_scoped_release release;
        return std::make_shared<CollisionProblem>(readCapture(path));
      },
      py::arg("path"), "read_capture(path) -> CollisionProblem\n\nReads a capture.");
  module.def(
      "set_up",
      [](const CollisionProblem& self) {
        const py::gil_scoped_release release;
        return std::make_shared<Collisions>(setUp(self));
      },
      py::arg("problem"),
      R"(set_up(problem) -> OctreeBasedCD

Makes an OctreeBasedCD from a problem, ready for detect_collision(). Geometry i has the id i.)");
}

}  // namespace palpate::python
