// Part of Python/Classes.h: pairs of an OctreeBasedCD.

#include "Python/Classes.h"
#include "Python/Collisions.h"
#include "Python/Records.h"

#include <algorithm>
#include <vector>

namespace palpate::python {
namespace {

py::object toPython(const CollisionPair& pair) {
  return lookedUp<CollisionPair>("palpate", "CollisionPair")(
      static_cast<std::uint32_t>(pair.a), static_cast<std::uint32_t>(pair.b), pair.settings);
}

/// The function of Python as a predicate: a worker thread takes the GIL for each call.
ContactPredicate predicateOf(const py::object& function) {
  if (function.is_none()) return {};
  return [callback = Callback(function)](const ContactFeatures& features) {
    const py::gil_scoped_acquire acquire;
    const auto ids = [](const std::array<std::uint32_t, 2>& side) {
      return py::make_tuple(side[0], side[1]);
    };
    const py::object argument = lookedUp<ContactFeatures>("palpate", "ContactFeatures")(
        features.kind, ids(features.a), ids(features.b), features.tagA, features.tagB);
    const int truth = PyObject_IsTrue(callback.get()(argument).ptr());
    if (truth < 0) throw py::error_already_set();
    return truth == 1;
  };
}

/// Candidate pairs for a function of Python: a worker thread takes the GIL for each batch.
void forEachCandidate(Collisions& self, const py::args& arguments) {
  if (arguments.size() != 1 && arguments.size() != 3)
    throw py::type_error(
        "for_each_candidate() takes a function, or two geometries and a function.");
  const Callback callback{py::object(arguments[arguments.size() - 1])};
  if (arguments.size() == 3) {
    const GeometryId a = geometryId(arguments[0]), b = geometryId(arguments[1]);
    return self.work([&](OctreeBasedCD& d) {
      d.forEachCandidate(a, b, [&](std::span<const ElementPair> batch) {
        const py::gil_scoped_acquire acquire;
        callback.get()(copyOf(batch));
      });
    });
  }
  self.work([&](OctreeBasedCD& d) {
    d.forEachCandidate([&](const CollisionPair& pair, std::span<const ElementPair> batch) {
      const py::gil_scoped_acquire acquire;
      callback.get()(toPython(pair), copyOf(batch));
    });
  });
}

/// One integer or many, each of 64 bits without a sign.
std::vector<std::uint64_t> wordsIn(const py::object& data) {
  std::vector<std::uint64_t> words;
  const py::object numbers = py::module_::import("numpy").attr("array")(data, "object");
  for (const py::handle item : numbers.attr("flat")) {
    const auto integer = py::reinterpret_steal<py::object>(PyNumber_Index(item.ptr()));
    if (!integer) throw py::error_already_set();
    words.push_back(PyLong_AsUnsignedLongLong(integer.ptr()));
    if (PyErr_Occurred() != nullptr) throw py::error_already_set();
  }
  return words;
}

bool hasTracked(const CollisionData& data, const ContactKey& key) {
  for (const auto list : {data.trackedVertexTriangle(), data.trackedTriangleVertex(),
                          data.trackedEdgeEdge(), data.trackedShape(), data.trackedShapeShape()})
    if (std::ranges::binary_search(list, key, {}, &TrackedContact::key)) return true;
  return false;
}

}  // namespace

void addPairs(CollisionsClass& collisions) {
  using Object = const py::object&;
  collisions
      .def(
          "add_collision_pair",
          [](Collisions& self, Object first, Object second, Object settings,
             const py::kwargs& keywords) {
            const GeometryId a = geometryId(first), b = geometryId(second);
            const auto value = settingsOf<PairSettings>(settings, keywords);
            self.change([&](OctreeBasedCD& d) { d.addCollisionPair(a, b, value); });
          },
          py::arg("a"), py::arg("b"), py::arg("settings") = py::none(),
          R"(add_collision_pair(a, b, settings=None, **keywords) -> None

Adds a pair that each detection tests; a == b tests a geometry with itself. Keywords are those of
PairSettings, as method="continuous", thickness=0.1.)")
      .def(
          "set_pair_settings",
          [](Collisions& self, Object first, Object second, Object settings,
             const py::kwargs& keywords) {
            const GeometryId a = geometryId(first), b = geometryId(second);
            const auto value = settingsOf<PairSettings>(settings, keywords);
            self.change([&](OctreeBasedCD& d) { d.setPairSettings(a, b, value); });
          },
          py::arg("a"), py::arg("b"), py::arg("settings") = py::none(),
          R"(set_pair_settings(a, b, settings=None, **keywords) -> None

Replaces the settings of a pair. What no keyword names has its default, or its value in `settings`.)")
      .def(
          "set_contact_predicate",
          [](Collisions& self, Object first, Object second, Object predicate) {
            const GeometryId a = geometryId(first), b = geometryId(second);
            ContactPredicate function = predicateOf(predicate);
            self.change(
                [&](OctreeBasedCD& d) { d.setContactPredicate(a, b, std::move(function)); });
          },
          py::arg("a"), py::arg("b"), py::arg("predicate"),
          R"(set_contact_predicate(a, b, predicate) -> None

Sets a function that receives ContactFeatures and returns whether they may be a contact; None
refuses nothing. Threads of the frame call it in any order, one at a time as it holds the GIL. An
exception ends the frame, and detect_collision() raises it.)")
      .def(
          "remove_collision_pair",
          [](Collisions& self, Object first, Object second) {
            const GeometryId a = geometryId(first), b = geometryId(second);
            self.change([&](OctreeBasedCD& d) { d.removeCollisionPair(a, b); });
          },
          py::arg("a"), py::arg("b"),
          "remove_collision_pair(a, b) -> None\n\nRemoves a pair and its answer.")
      .def(
          "pairs",
          [](Collisions& self) {
            return self.read([](OctreeBasedCD& d) {
              py::list pairs;
              for (const CollisionPair& pair : d.pairs()) pairs.append(toPython(pair));
              return pairs;
            });
          },
          "pairs() -> list[CollisionPair]\n\nAll pairs, in the order in which they were added.")
      .def(
          "pair_settings",
          [](Collisions& self, Object first, Object second) {
            const GeometryId a = geometryId(first), b = geometryId(second);
            return self.read([&](OctreeBasedCD& d) { return d.pairSettings(a, b); });
          },
          py::arg("a"), py::arg("b"), "pair_settings(a, b) -> PairSettings\n\nAs set last.")
      .def(
          "collision_data",
          [](Collisions& self, Object first, Object second) {
            const GeometryId a = geometryId(first), b = geometryId(second);
            return self.read([&](OctreeBasedCD& d) {
              return std::make_shared<CollisionData>(d.collisionData(a, b));
            });
          },
          py::arg("a"), py::arg("b"),
          R"(collision_data(a, b) -> CollisionData

A copy of the answer of the last detection, in the order in which the pair was added.)")
      .def(
          "set_user_data",
          [](Collisions& self, Object first, Object second, Object keys, Object data) {
            const GeometryId a = geometryId(first), b = geometryId(second);
            const std::vector<ContactKey> contacts = structsIn<ContactKey>(keys);
            const std::vector<std::uint64_t> words = wordsIn(data);
            if (words.size() != 1 && words.size() != contacts.size())
              throw py::value_error("data has " + std::to_string(words.size()) + " numbers for " +
                                    std::to_string(contacts.size()) + " keys");
            self.change([&](OctreeBasedCD& d) {
              // The first key without a contact throws before anything changes.
              const auto missing = std::ranges::find_if(contacts, [&](const ContactKey& key) {
                return !hasTracked(d.collisionData(a, b), key);
              });
              if (missing != contacts.end()) d.setUserData(a, b, *missing, 0);
              for (std::size_t i = 0; i < contacts.size(); ++i)
                d.setUserData(a, b, contacts[i], words[words.size() == 1 ? 0 : i]);
            });
          },
          py::arg("a"), py::arg("b"), py::arg("keys"), py::arg("data"),
          R"(set_user_data(a, b, keys, data) -> None

Gives 64 bits each to contacts of the last detection, for as long as they last and then to their
successors. keys: the field `key` of records such as CollisionData.tracked_edge_edge, or one of
them. data: one integer, or one for each key.)")
      .def(
          "set_remembered_sides",
          [](Collisions& self, Object first, Object second, Object sides) {
            const GeometryId a = geometryId(first), b = geometryId(second);
            const std::vector<Crossing> all = structsIn<Crossing>(sides);
            self.change([&](OctreeBasedCD& d) { d.setRememberedSides(a, b, all); });
          },
          py::arg("a"), py::arg("b"), py::arg("sides"),
          R"(set_remembered_sides(a, b, sides) -> None

Replaces CollisionData.remembered_sides of the present step by such records; an empty array of them,
as CollisionData.remembered_sides[:0], forgets all sides.)")
      .def(
          "free_motion",
          [](Collisions& self, Object geometry) {
            const GeometryId id = geometryId(geometry);
            return self.read([&](OctreeBasedCD& d) { return copyOf(d.freeMotion(id)); });
          },
          py::arg("geometry"),
          R"(free_motion(geometry) -> numpy.ndarray

(n,) lengths that the vertices may move from their positions in the last detection before anything
new comes into contact; of a shape (1,) for all its points. Only pairs with
PairSettings.free_motion_reach count; without one it is infinity.)")
      .def(
          "candidate_pairs",
          [](Collisions& self, Object first, Object second) {
            const GeometryId a = geometryId(first), b = geometryId(second);
            std::vector<ElementPair> pairs;
            self.work([&](OctreeBasedCD& d) { pairs = d.candidatePairs(a, b); });
            return copyOf(pairs);
          },
          py::arg("a"), py::arg("b"),
          R"(candidate_pairs(a, b) -> numpy.ndarray

(n, 2) elements whose boxes overlap, ascending. Updates octrees if needed.)")
      .def(
          "pair_statistics",
          [](Collisions& self, Object first, Object second) {
            const GeometryId a = geometryId(first), b = geometryId(second);
            return self.read([&](OctreeBasedCD& d) { return d.pairStatistics(a, b); });
          },
          py::arg("a"), py::arg("b"),
          "pair_statistics(a, b) -> PairStatistics\n\nTime and counts in the last frame.")
      .def("for_each_candidate", &forEachCandidate,
           R"(for_each_candidate(a, b, function) -> None
for_each_candidate(function) -> None

Passes candidate pairs in batches: function(batch) with an (n, 2) array, or for every pair
function(pair, batch) with a CollisionPair. Calls come one at a time, from several threads.)");
}

}  // namespace palpate::python
