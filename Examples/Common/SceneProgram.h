#pragma once

#include "World.h"

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace CLI {
class App;
}

namespace palpate::scenes {

/// A scene that is computed frame by frame.
class LiveScene {
 public:
  virtual ~LiveScene() = default;
  virtual void computeFrame(int frame) = 0;
  virtual World& world() = 0;
  /// What was chosen for this run, for whoever reads its figures.
  virtual std::string settings() { return ""; }
  /// Of the frame just computed: columns and their values, the same columns in every frame.
  virtual std::vector<std::pair<std::string, double>> values() { return {}; }
  /// What the scene promises and the frame just computed does not hold, as a sentence; else empty.
  virtual std::string fault() { return ""; }
  /// Of those computed, the one whose picture says most, where a frame needs none before it; else
  /// the picture is of the last.
  virtual std::optional<int> frameToShow() { return {}; }
};

struct SceneProgram {
  std::string name, description;
  int frames;                        ///< of the whole story
  double frameMilliseconds;          ///< budget of a frame with the solver
  double collisionMilliseconds = 0;  ///< budget of its collision detection; 0: none
  std::string keys{};                ///< of vtk::Window, pressed before it shows anything
  std::function<void(CLI::App&)> addOptions{};
  std::function<std::unique_ptr<LiveScene>(int threads)> make{};
};

/// main() of a scene: reads the command line, computes the frames, prints times beside budgets,
/// writes frames.csv, report.html and, with a display, scene.png.
///
/// Returns  the exit code. Not 0 where something is wrong with the call or the scene did not hold
///          what it promises: one sentence says what, and nothing is written.
int runScene(const SceneProgram&, int count, char** arguments);

/// Throws Error: the file cannot be used, or the program was built without VTK.
SceneMesh readMesh(const std::filesystem::path&);

}  // namespace palpate::scenes
