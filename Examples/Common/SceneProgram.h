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
  /// The options of this run, for readers of its figures.
  virtual std::string settings() { return ""; }
  /// Columns and values of the last computed frame. The columns are the same in every frame.
  virtual std::vector<std::pair<std::string, double>> values() { return {}; }
  /// The promise of the scene that the last computed frame breaks, as a sentence, or an empty text.
  virtual std::string fault() { return ""; }
  /// The best frame for a picture, if it needs no earlier frame. Otherwise the picture shows the
  /// last frame.
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
/// Returns  the exit code. It is not 0 if the call is wrong or the scene broke its promise. Then
///          one sentence gives the reason, and nothing is written.
int runScene(const SceneProgram&, int count, char** arguments);

/// Throws Error if the file cannot be used, or if the program was built without VTK.
SceneMesh readMesh(const std::filesystem::path&);

}  // namespace palpate::scenes
