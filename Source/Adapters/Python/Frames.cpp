// Part of Python/Classes.h: frames and their statistics.

#include "Python/Classes.h"
#include "Python/Collisions.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

namespace palpate::python {

namespace {

std::chrono::microseconds microsecondsOf(double seconds) {
  if (std::isnan(seconds))
    throw Error(ErrorCode::InvalidSettings, "budget is not a number; it must be in seconds");
  constexpr double kMost = 1e9;
  return std::chrono::microseconds(
      static_cast<std::int64_t>(1e6 * std::clamp(seconds, -kMost, kMost)));
}

}  // namespace

void addFrames(CollisionsClass& collisions) {
  collisions
      .def(
          "advance", [](Collisions& self) { self.work([](OctreeBasedCD& d) { d.advance(); }); },
          R"(advance() -> None

Ends the step: the positions now become those before. With PairSettings.remember_sides it detects
crossings up to positions that were set after the last detection. Releases the GIL.)")
      .def(
          "update", [](Collisions& self) { self.work([](OctreeBasedCD& d) { d.update(); }); },
          "update() -> None\n\nBrings octrees to the positions now. Others do so themselves.")
      .def(
          "detect_collision",
          [](Collisions& self, const std::optional<double>& budget) {
            return self.work([&](OctreeBasedCD& d) {
              if (budget) return d.detectCollision(microsecondsOf(*budget));
              d.detectCollision();
              return true;
            });
          },
          py::arg("budget") = py::none(),
          R"(detect_collision(budget=None) -> bool

Finds the contacts of every pair; see collision_data(). Releases the GIL.
budget: seconds, after which pairs keep their last answer. Returns whether all were finished.)")
      .def(
          "cancel_detection", [](const Collisions& self) { self.detection.cancelDetection(); },
          R"(cancel_detection() -> None

Ends a detect_collision() with a budget that another thread runs.)")
      .def(
          "write_trace",
          [](Collisions& self, const std::filesystem::path& path) {
            self.read([&](OctreeBasedCD& d) { d.writeTrace(path); });
          },
          py::arg("path"),
          R"(write_trace(path) -> None

Writes the times of the last Settings.trace_frames detections as JSON for Perfetto and Chrome.)")
      .def(
          "save",
          [](Collisions& self) {
            const std::vector<std::byte> state =
                self.read([](OctreeBasedCD& d) { return d.save(); });
            return bytesOf(state);
          },
          R"(save() -> bytes

The state: geometries and pairs with their ids, the step, the last answers, contacts over time.)")
      .def(
          "restore",
          [](Collisions& self, const py::bytes& state) {
            self.work([&](OctreeBasedCD& d) { d.restore(bytesIn(state)); });
          },
          py::arg("state"),
          R"(restore(state) -> None

Goes back to a state of this or another object: the next frames have the same bits. Predicates and
distance fields are those of this object. Raises Error for other or changed bytes.)")
      .def(
          "memory_use",
          [](Collisions& self) {
            return self.read([](OctreeBasedCD& d) { return d.memoryUse(); });
          },
          "memory_use() -> MemoryUse\n\nThe bytes that the object holds now.")
      .def(
          "release_memory",
          [](Collisions& self) { self.change([](OctreeBasedCD& d) { d.releaseMemory(); }); },
          "release_memory() -> None\n\nGives back what is only kept for the next frames.")
      .def(
          "statistics",
          [](Collisions& self) {
            return self.read([](OctreeBasedCD& d) { return FrameStatistics(d.statistics()); });
          },
          "statistics() -> FrameStatistics\n\nTimes and counts of the last frame.")
      .def(
          "settings",
          [](Collisions& self) {
            return self.read([](OctreeBasedCD& d) { return Settings(d.settings()); });
          },
          "settings() -> Settings\n\nThe settings with which the object was made.")
      .def("__repr__", [](Collisions& self) {
        if (!self.gate.isOpen(false)) return std::string("<palpate.OctreeBasedCD at work>");
        const std::size_t geometries = self.detection.statistics().geometries;
        const std::size_t pairs = self.detection.pairs().size();
        return "<palpate.OctreeBasedCD with " + std::to_string(pairs) + " pairs, " +
               std::to_string(geometries) + " geometries in the last frame>";
      });
}

}  // namespace palpate::python
