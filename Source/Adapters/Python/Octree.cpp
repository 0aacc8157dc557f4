// Part of Python/Classes.h: the octrees.

#include "Python/Classes.h"
#include "Python/Collisions.h"

namespace palpate::python {
namespace {

/// The object behind palpate.LooseOctree: the octrees of an object that it keeps alive.
struct Octrees {
  std::shared_ptr<Collisions> owner;

  template <class F>
  auto read(F&& f) const {
    return owner->read([&](OctreeBasedCD& d) { return f(d.octree()); });
  }
};

py::array_t<double> boxOf(const Eigen::AlignedBox3d& box) {
  return copyOf(std::vector<Eigen::Vector3d>{box.min(), box.max()});
}
py::list nodes(const Octrees& self, const py::object& geometry) {
  const GeometryId id = geometryId(geometry);
  return self.read([&](const LooseOctree& octree) {
    py::list list;
    for (const LooseOctree::Node& n : octree.nodes(id)) {
      const py::object parent =
          n.parent == kNoElement ? py::object(py::none()) : py::int_(n.parent);
      list.append(lookedUp<LooseOctree::Node>("palpate", "OctreeNode")(
          static_cast<std::uint32_t>(n.geometry), n.depth, boxOf(n.bounds), boxOf(n.looseBounds),
          boxOf(n.fittedBox), parent, copyOf(n.elements)));
    }
    return list;
  });
}

py::list geometries(const Octrees& self) {
  py::list list;
  for (const GeometryId id :
       self.read([](const LooseOctree& octree) { return octree.geometries(); }))
    list.append(static_cast<std::uint32_t>(id));
  return list;
}

}  // namespace

void addOctree(py::module_& module, CollisionsClass& collisions) {
  py::class_<Octrees>(module, "LooseOctree",
                      R"(A view of the octrees of the last update, for diagnostics and display.

There is one octree for each geometry with elements. Each update changes what it shows. What its
methods return are copies.)")
      .def("nodes", &nodes, py::arg("geometry"),
           R"(nodes(geometry) -> list[OctreeNode]

The nodes that have elements in their subtree. A parent comes before its children.)")
      .def("geometries", &geometries,
           "geometries() -> list[int]\n\nThe geometries with nodes, ascending.")
      .def(
          "last_update",
          [](const Octrees& self, const py::object& geometry) {
            const GeometryId id = geometryId(geometry);
            return self.read([&](const LooseOctree& octree) { return octree.lastUpdate(id); });
          },
          py::arg("geometry"),
          "last_update(geometry) -> LooseOctreeUpdate\n\nWhat the last update did to its tree.")
      .def(
          "statistics",
          [](const Octrees& self) {
            return self.read([](const LooseOctree& octree) { return octree.statistics(); });
          },
          "statistics() -> OctreeStatistics\n\nSizes of all octrees together.")
      .def(
          "validate",
          [](const Octrees& self) {
            return self.read([](const LooseOctree& octree) { return octree.validate(); });
          },
          "validate() -> list[str]\n\nOne sentence for each invariant that does not hold.")
      .def("__repr__", [](const Octrees& self) {
        return self.read([](const LooseOctree& octree) {
          const OctreeStatistics s = octree.statistics();
          return "<palpate.LooseOctree with " + std::to_string(s.nodesInUse) + " nodes, " +
                 std::to_string(s.elements) + " elements>";
        });
      });
  collisions.def(
      "octree", [](const std::shared_ptr<Collisions>& self) { return Octrees{self}; },
      "octree() -> LooseOctree\n\nThe octrees of all geometries, as of the last update.");
}

}  // namespace palpate::python
