// Part of Python/Classes.h: the extension module.

#include "Python/Classes.h"
#include "Python/Collisions.h"

#include <palpate/Executor.h>

namespace palpate::python {

void addErrors(py::module_& module) {
  py::register_exception_translator([](std::exception_ptr pointer) {
    try {
      if (pointer) std::rethrow_exception(pointer);
    } catch (const Error& error) {
      const py::handle type = lookedUp<Error>("palpate._errors", "Error");
      const auto optional = [](const auto& value) -> py::object {
        if (!value) return py::none();
        return py::int_(static_cast<std::size_t>(*value));
      };
      const py::object exception =
          type(error.what(), error.code(), optional(error.geometry()), optional(error.element()));
      PyErr_SetObject(type.ptr(), exception.ptr());
    }
  });
  module.attr("NO_ELEMENT") = kNoElement;
  module.attr("LARGEST_MEASURE") = kLargestMeasure;
  module.attr("MAX_HULL_POINTS") = kMaxHullPoints;
  module.attr("INFINITY") = kInfinity;
  module.def("simd_path", &simdPath,
             "simd_path() -> str\n\nThe instruction set that the library uses in this process. "
             "Results do not depend on it.");
}

}  // namespace palpate::python

PYBIND11_MODULE(_palpate, module) {
  using namespace palpate::python;
  py::options options;
  options.disable_function_signatures();  // the first line of each text has PEP 8's
  module.doc() = "The extension module of palpate. Import palpate instead.";
  addErrors(module);
  addSettings(module);
  CollisionsClass collisions(module, "OctreeBasedCD",
                             R"(Collision detection of deforming meshes, lines, points and shapes.

OctreeBasedCD(settings=None, **keywords): keywords are those of Settings.

Add geometries and pairs once. Then call in each step set_positions(), detect_collision(),
collision_data() and advance(). A step runs from the positions at the last advance() to the
positions now. L is the length unit of the positions; all lengths are in L.

Arrays    positions are (n, 3) float64. Arrays that are C-contiguous are read without a copy, others
          are converted. Indices are integers of any width. Arrays that come out own their memory,
          or keep alive what they show; they never change.
Errors    palpate.Error, with code, geometry and element. The object is then unchanged.
Threads   frames and batches of queries release the GIL. While a call that changes the object is
          at work, calls of other threads or from callbacks raise Error INVALID_CALL.
          latest_snapshot() is always allowed.)");
  collisions.def(
      py::init([](const py::object& settings, const py::kwargs& keywords) {
        return std::make_shared<Collisions>(settingsOf<palpate::Settings>(settings, keywords));
      }),
      py::arg("settings") = py::none());
  addCollisionData(module);
  addFields(module);
  addGeometries(collisions);
  addPairs(collisions);
  addFrames(collisions);
  addOctree(module, collisions);
  addQueries(module);
  addSnapshots(module, collisions);
  addStepGuard(module);
  addThreadTopology(module);
  addCapture(module, collisions);
  addFunctions(module);
  addMeshFiles(module);
}
