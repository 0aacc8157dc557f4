// Five deforming organs, or the user's own meshes, glide through each other: contacts of each
// frame, what each stage of it cost, and a picture.
#include "CommandLine.h"
#include "Report.h"
#include "Scenes.h"

#include <palpate/Palpate.h>
#ifdef PALPATE_HAS_VTK
#include <palpate/vtk/MeshFile.h>
#include <palpate/vtk/Window.h>
#endif

#include <CLI/CLI.hpp>

#include <chrono>
#include <cstdio>
#include <filesystem>
#include <map>
#include <optional>

namespace {

using namespace palpate;
using Clock = std::chrono::steady_clock;

struct Options {
  int frames = 120;
  std::filesystem::path out = "out";
  std::vector<std::string> meshes;
  int threads = 0;
  Method method = Method::Proximity;
  std::optional<double> thickness;
};

double since(Clock::time_point start) {
  return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

scenes::Scene sceneOf(const Options& options) {
  if (options.meshes.empty()) return scenes::organs();
#ifdef PALPATE_HAS_VTK
  std::vector<scenes::SceneMesh> meshes;
  for (const std::string& path : options.meshes) {
    vtk::MeshFile file = vtk::readTriangleMesh(path);
    meshes.push_back({std::move(file.positions), std::move(file.triangles)});
  }
  return scenes::glidingMeshes(std::move(meshes));
#else
  throw Error(ErrorCode::NotAvailable,
              "This program was built without VTK and cannot read mesh files.");
#endif
}

double thickness(const scenes::Scene& scene, const Options& options) {
  const bool touching =
      options.method == Method::Intersection || options.method == Method::Continuous;
  return options.thickness.value_or(touching ? 0.0 : scene.thickness);
}

/// A scene in a collision detection, moved from frame to frame.
class Simulation {
 public:
  Simulation(const scenes::Scene& scene, const Options& options)
      : m_scene(scene),
        m_positions(m_scene.meshes.size()),
        m_detection({.threads = options.threads}) {
    move(0);
    for (std::size_t m = 0; m < m_positions.size(); ++m) {
      m_ids.push_back(m_detection.addTriangleMesh(m_positions[m], m_scene.meshes[m].triangles));
    }
    const PairSettings settings{.method = options.method, .thickness = thickness(scene, options)};
    for (const auto& [a, b] : m_scene.pairs)
      m_detection.addCollisionPair(m_ids[a], m_ids[b], settings);
  }

  /// Returns the wall-clock milliseconds from positions to contacts.
  double computeFrame(int frame) {
    move(frame);
    const auto start = Clock::now();
    for (std::size_t m = 0; m < m_ids.size(); ++m)
      m_detection.setPositions(m_ids[m], m_positions[m]);
    m_detection.detectCollision();
    return since(start);
  }

  const OctreeBasedCD& detection() const { return m_detection; }

#ifdef PALPATE_HAS_VTK
  std::string png() const {
    vtk::Window window(m_detection, false);
    window.press('o');
    window.show();
    return vtk::toPng(window.image());
  }
#endif

 private:
  void move(int frame) {
    for (std::size_t m = 0; m < m_positions.size(); ++m)
      m_scene.positions(frame, m, m_positions[m]);
  }

  const scenes::Scene& m_scene;
  std::vector<std::vector<Eigen::Vector3d>> m_positions;
  OctreeBasedCD m_detection;
  std::vector<GeometryId> m_ids;
};

scenes::Report computeFrames(Simulation& simulation, int frames) {
  scenes::Report report;
  auto lastNews = Clock::now();
  for (int frame = 0; frame < frames; ++frame) {
    const double milliseconds = simulation.computeFrame(frame);
    report.add(simulation.detection(), milliseconds);
    if (since(lastNews) > 1000) {
      std::fprintf(stderr, "frame %d of %d\n", frame + 1, frames);
      lastNews = Clock::now();
    }
  }
  return report;
}

void run(const Options& options) {
  const scenes::Scene scene = sceneOf(options);
  Simulation simulation(scene, options);
  scenes::makeFolder(options.out);
  std::printf("%zu meshes, %zu triangles, %zu pairs, thickness %g\n", scene.meshes.size(),
              scene.triangleCount(), scene.pairs.size(), thickness(scene, options));
  const scenes::Report report = computeFrames(simulation, options.frames);
  std::fputs(report.summary().c_str(), stdout);
  scenes::writeWhole(options.out / "frames.csv", report.csv());
  std::printf("frames                 %s\n", (options.out / "frames.csv").c_str());
#ifdef PALPATE_HAS_VTK
  const int frame = report.typicalFrame();
  Simulation still(scene, options);  // whose octree is built for this very frame
  still.computeFrame(frame);
  try {
    scenes::writeWhole(options.out / "scene.png", still.png());
    std::printf("picture of frame %-5d %s\n", frame, (options.out / "scene.png").c_str());
  } catch (const Error& error) {
    if (error.code() != ErrorCode::NotAvailable) throw;
    std::printf("no picture             %s\n", error.what());
  }
#else
  std::printf("no picture             built without VTK\n");
#endif
}

Options parse(CLI::App& app, int count, char** arguments) {
  Options options;
  app.add_option("--frames", options.frames, "frames to compute; the motion repeats after 120")
      ->check(CLI::Range(1, 1'000'000))
      ->capture_default_str();
  app.add_option("--out", options.out, "folder for frames.csv and scene.png")
      ->capture_default_str();
  app.add_option("--mesh", options.meshes,
                 "OBJ, STL, PLY or VTK files to use instead of the organs");
  app.add_option("--threads", options.threads, "0: all cores")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  const std::map<std::string, Method> methods{{"auto", Method::Auto},
                                              {"intersection", Method::Intersection},
                                              {"proximity", Method::Proximity},
                                              {"continuous", Method::Continuous}};
  app.add_option("--method", options.method, "auto, intersection, proximity or continuous")
      ->transform(CLI::CheckedTransformer(methods, CLI::ignore_case));
  app.add_option("--thickness", options.thickness,
                 "distance under which two features touch, in the meshes' unit; a twentieth of the "
                 "mean edge if absent, and 0 for intersection and continuous");
  app.failure_message(
      [](const CLI::App*, const CLI::Error& error) { return std::string(error.what()) + "\n"; });
  app.parse(count, arguments);
  return options;
}

}  // namespace

int main(int count, char** arguments) {
  CLI::App app("Deforming organs glide through each other.", "OrganScene");
  return scenes::exitCodeOf(app, [&] { run(parse(app, count, arguments)); });
}
