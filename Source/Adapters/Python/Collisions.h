#pragma once

#include "Python/Arrays.h"

#include <palpate/OctreeBasedCD.h>
#include <palpate/SpatialQueries.h>

#include <memory>
#include <utility>

namespace palpate::python {

/// Which calls are at work on an object of the library while they do not hold the GIL. The library
/// allows calls that read at the same time, and one call that changes the object alone. A call that
/// is not allowed throws instead of waiting, so that a predicate cannot deadlock.
///
/// Threads  use it with the GIL only.
class Gate {
 public:
  bool isOpen(bool toChange) const { return !m_changing && !(toChange && m_reading > 0); }

 private:
  friend class Passage;
  int m_reading = 0;
  bool m_changing = false;
};

/// One call at work. Make it and destroy it with the GIL.
class Passage {
 public:
  Passage(Gate& gate, bool changes) : m_gate(gate), m_changes(changes) {
    if (!gate.isOpen(changes))
      throw Error(ErrorCode::InvalidCall,
                  "The object is at work on another call, of another thread or from a callback.");
    if (changes)
      gate.m_changing = true;
    else
      ++gate.m_reading;
  }
  ~Passage() {
    if (m_changes)
      m_gate.m_changing = false;
    else
      --m_gate.m_reading;
  }
  Passage(const Passage&) = delete;
  Passage& operator=(const Passage&) = delete;

 private:
  Gate& m_gate;
  bool m_changes;
};

/// The object behind palpate.OctreeBasedCD.
struct Collisions {
  OctreeBasedCD detection;
  Gate gate;

  explicit Collisions(const Settings& settings) : detection(settings) {}
  explicit Collisions(OctreeBasedCD&& other) : detection(std::move(other)) {}

  /// f(detection), for a call that reads.
  template <class F>
  auto read(F&& f) {
    const Passage passage(gate, false);
    return f(detection);
  }
  /// f(detection), for a call that changes the object.
  template <class F>
  auto change(F&& f) {
    const Passage passage(gate, true);
    return f(detection);
  }
  /// f(detection), for a long call that changes the object: others have the GIL meanwhile.
  template <class F>
  auto work(F&& f) {
    const Passage passage(gate, true);
    const py::gil_scoped_release release;
    return f(detection);
  }
};

/// The object behind palpate.SpatialQueries. It keeps the OctreeBasedCD or the snapshot alive.
struct Queries {
  SpatialQueries queries;
  std::shared_ptr<Collisions> owner;         ///< null: of a snapshot
  std::shared_ptr<const Snapshot> snapshot;  ///< null: of an OctreeBasedCD

  /// f(queries) for a short call.
  template <class F>
  auto ask(F&& f) const {
    if (owner == nullptr) return f(queries);
    const Passage passage(owner->gate, false);
    return f(queries);
  }
  /// f(queries) for a long call: others have the GIL meanwhile.
  template <class F>
  auto askLong(F&& f) const {
    if (owner == nullptr) {
      const py::gil_scoped_release release;
      return f(queries);
    }
    const Passage passage(owner->gate, false);
    const py::gil_scoped_release release;
    return f(queries);
  }
};

/// A function of Python that C++ may call, copy and destroy on any thread, with or without the GIL.
class Callback {
 public:
  explicit Callback(py::object function)
      : m_function(new py::object(std::move(function)), [](py::object* object) {
          const py::gil_scoped_acquire acquire;
          delete object;
        }) {}
  /// Needs  the GIL.
  const py::object& get() const { return *m_function; }

 private:
  std::shared_ptr<py::object> m_function;
};

/// A progress callback for the library: None returned by Python means to go on.
std::function<bool(double)> progressOf(const py::object& function);

using CollisionsClass = py::class_<Collisions, std::shared_ptr<Collisions>>;

// Each file of the module adds its part.
void addErrors(py::module_& module);
void addSettings(py::module_& module);
void addCollisionData(py::module_& module);
void addGeometries(CollisionsClass& collisions);
void addPairs(CollisionsClass& collisions);
void addFrames(CollisionsClass& collisions);
void addOctree(py::module_& module, CollisionsClass& collisions);
void addQueries(py::module_& module);
void addRays(py::class_<Queries>& queries);
void addBodies(py::module_& module, py::class_<Queries>& queries);
void addFields(py::module_& module);
void addSnapshots(py::module_& module, CollisionsClass& collisions);
void addStepGuard(py::module_& module);
void addThreadTopology(py::module_& module);
void addCapture(py::module_& module, CollisionsClass& collisions);
void addFunctions(py::module_& module);
void addMeshFiles(py::module_& module);

}  // namespace palpate::python
