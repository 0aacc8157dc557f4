#include "Python/Classes.h"
#include "Python/Collisions.h"

#include <palpate/Executor.h>

namespace palpate::python {
namespace {

Eigen::Matrix3d rotationOf(const py::handle& object) {
  const Positions rows(object, "rotation");
  if (rows.size() != 3)
    throw Error(ErrorCode::WrongPositionCount, "A rotation must have the shape (3, 3).");
  Eigen::Matrix3d rotation;
  for (int row = 0; row < 3; ++row)
    rotation.row(row) = rows.span()[static_cast<std::size_t>(row)].transpose();
  return rotation;
}

}  // namespace

Pose poseOf(const py::handle& pose) {
  return {rotationOf(pose.attr("rotation")), position(pose.attr("translation"), "translation")};
}

py::object toPython(const Pose& pose) {
  return lookedUp<Pose>("palpate", "Pose")(copyOf(pose.rotation), copyOf(pose.translation));
}

RigidMotion motionOf(const py::handle& motion) {
  if (motion.is_none()) return {};
  return {poseOf(motion.attr("before")), poseOf(motion.attr("now"))};
}

py::object toPython(const RigidMotion& motion) {
  return lookedUp<RigidMotion>("palpate", "RigidMotion")(toPython(motion.before),
                                                         toPython(motion.now));
}

AnalyticalGeometry shapeOf(const py::handle& shape) {
  AnalyticalGeometry result;
  const auto take = [&]<class Shape>(const Shape*) {
    if (!py::isinstance(shape, classOf<Shape>())) return false;
    result = shape.cast<Shape>();
    return true;
  };
  const auto takeAny = [&]<class... Shapes>(const std::variant<Shapes...>*) {
    return (take(static_cast<const Shapes*>(nullptr)) || ...);
  };
  if (!takeAny(static_cast<const AnalyticalGeometry*>(nullptr)))
    throw py::type_error("A shape must be a Sphere, Capsule, Plane, Box, Cylinder or ConvexHull.");
  return result;
}

py::object toPython(const AnalyticalGeometry& shape) {
  return std::visit([](const auto& alternative) -> py::object { return py::cast(alternative); },
                    shape);
}

std::function<bool(double)> progressOf(const py::object& function) {
  if (function.is_none()) return {};
  return [callback = Callback(function)](double fraction) {
    const py::gil_scoped_acquire acquire;
    const py::object goOn = callback.get()(fraction);
    return goOn.is_none() || goOn.cast<bool>();
  };
}

void addSettings(py::module_& module) {
  py::class_<Executor, std::shared_ptr<Executor>>(
      module, "Executor",
      "Threads that several objects share; see make_thread_pool() and Settings.")
      .def_property_readonly("concurrency", &Executor::concurrency,
                             "The number of tasks that can run at the same time.")
      .def("__repr__", [](const Executor& self) {
        return "<palpate.Executor with " + std::to_string(self.concurrency()) + " threads>";
      });
  module.def("make_thread_pool", &makeThreadPool, py::arg("threads") = 0,
             R"(make_thread_pool(threads=0) -> Executor

A thread pool that several OctreeBasedCD may share. threads: in [1, 1024]; 0: one per core.)");
}

}  // namespace palpate::python
