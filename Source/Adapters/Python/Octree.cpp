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
py::object idOf(const std::optional<LooseOctree::NodeId>& id) {
  if (!id) return py::none();
  return py::int_(static_cast<std::uint32_t>(*id));
}

py::array_t<std::uint32_t> nodes(const Octrees& self, const py::object& geometry) {
  const std::vector<LooseOctree::NodeId> ids = self.read([&](const LooseOctree& octree) {
    return geometry.is_none() ? octree.nodes() : octree.nodes(geometryId(geometry));
  });
  return copyOf(std::span(reinterpret_cast<const std::uint32_t*>(ids.data()), ids.size()));
}

py::object node(const Octrees& self, const py::object& id) {
  const LooseOctree::NodeId wanted{elementIndex(id, "node")};
  return self.read([&](const LooseOctree& octree) {
    const LooseOctree::Node n = octree.node(wanted);
    py::tuple children(n.children.size());
    for (std::size_t i = 0; i < n.children.size(); ++i) children[i] = idOf(n.children[i]);
    return lookedUp<LooseOctree::Node>("palpate", "OctreeNode")(
        static_cast<std::uint32_t>(n.geometry), n.depth, boxOf(n.bounds), boxOf(n.looseBounds),
        boxOf(n.fittedBox), n.geometries, idOf(n.parent), children, copyOf(n.elements), n.leaf);
  });
}

}  // namespace

void addOctree(py::module_& module, CollisionsClass& collisions) {
  py::class_<Octrees>(module, "LooseOctree",
                      R"(A view of the octrees of the last update, for diagnostics and display.

There is one octree for each geometry with elements. Each update changes what it shows, and node ids
are valid until the next update. What its methods return are copies.)")
      .def("nodes", &nodes, py::arg("geometry") = py::none(),
           R"(nodes(geometry=None) -> numpy.ndarray

(n,) ids of the nodes in use of one geometry, or of all. A parent comes before its children.)")
      .def(
          "root",
          [](const Octrees& self, const py::object& geometry) {
            const GeometryId id = geometryId(geometry);
            return idOf(self.read([&](const LooseOctree& octree) { return octree.root(id); }));
          },
          py::arg("geometry"), "root(geometry) -> int | None\n\nNone if there are no nodes.")
      .def("node", &node, py::arg("node"), "node(node) -> OctreeNode\n\nA copy of a node.")
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
