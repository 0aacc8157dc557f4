#pragma once

#include "World.h"

#include <array>
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

using Colour = std::array<double, 3>;  ///< red, green and blue in [0, 1]

/// Colours of pictures. Colour-blind readers can tell them apart by lightness.
inline constexpr Colour kLiverColour{0.45, 0.10, 0.07}, kStomachColour{0.90, 0.62, 0.54},
    kKidneyColour{0.66, 0.30, 0.22}, kSpleenColour{0.64, 0.49, 0.53},
    kGallbladderColour{0.88, 0.82, 0.58}, kTissueColour{0.90, 0.68, 0.58},
    kBoneColour{0.93, 0.89, 0.80}, kSteelColour{0.62, 0.66, 0.72}, kNeedleColour{0.35, 0.40, 0.48},
    kThreadColour{0.10, 0.35, 0.75}, kBloodColour{0.70, 0.10, 0.12}, kForceColour{0.80, 0.30, 0.0};

/// How a picture shows a body, or its elements from `firstElement` on.
struct BodyLook {
  World::BodyId body;
  std::string label;  ///< its name in the picture; empty: none
  Colour colour;
  double opacity = 1.0;
  bool frontFaces = true;  ///< false: the picture shows a cavity from inside
  std::uint32_t firstElement = 0;
  double roughness = 0.4;  ///< wet tissue 0.3, bone 0.7
  double metallic = 0;
  bool isCut = true;  ///< false: a section leaves the body whole
};

/// A text in a picture. With `from`, an arrow leads from there to `at`, and the text stands there.
struct PictureNote {
  std::string text;
  Eigen::Vector3d at;
  std::optional<Eigen::Vector3d> from{};
  Colour colour{0.1, 0.1, 0.12};
};

/// An arrow from a point along a force in newtons, with its size at the tip. length: L, of 1 N.
std::vector<PictureNote> forceNotes(const Eigen::Vector3d& at, const Eigen::Vector3d& newtons,
                                    double length);

/// What a picture shows.
struct PictureView {
  Eigen::Vector3d from{0.5, -1.0, 0.6};  ///< from the scene to the camera
  Eigen::Vector3d up{0, 0, 1};
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  double height = 0;  ///< L, about the centre; 0: everything is in view
  Eigen::Vector3d inset = Eigen::Vector3d::Zero();
  double insetHeight = 0;                   ///< L, of an enlarged part about `inset`; 0: none
  bool insetLeft = false, insetTop = true;  ///< its corner
  std::optional<Plane> section{};           ///< what is out of its half-space is not shown
};

/// A scene that is computed frame by frame.
class LiveScene {
 public:
  virtual ~LiveScene() = default;
  virtual void computeFrame(int frame) = 0;
  virtual World& world() = 0;
  /// The options of this run, for readers of its figures.
  virtual std::string settings() { return ""; }
  /// Columns and values of the last computed frame. The columns are the same in every frame. A name
  /// ends with its unit, as "force mN"; that of a number or a share has none.
  virtual std::vector<std::pair<std::string, double>> values() { return {}; }
  /// Sentences about the whole run, which the program prints and the report shows.
  virtual std::vector<std::string> findings() { return {}; }
  /// The promise of the scene that the last computed frame breaks, as a sentence, or an empty text.
  virtual std::string fault() { return ""; }
  /// The best frame for a picture, if it needs no earlier frame. Otherwise the picture shows the
  /// last frame.
  virtual std::optional<int> frameToShow() { return {}; }
  virtual std::vector<BodyLook> looks() { return {}; }
  virtual PictureView view() { return {}; }
  virtual std::vector<PictureNote> notes() { return {}; }  ///< on the last computed frame
};

struct SceneProgram {
  std::string name, description;
  int frames;                        ///< of the whole story
  double frameMilliseconds;          ///< budget of a frame with the solver
  double collisionMilliseconds = 0;  ///< budget of its collision detection; 0: none
  std::string keys{};                ///< of vtk::Window, pressed before it shows anything
  std::string unit = "mm";           ///< of lengths
  bool isUnitFree = false;           ///< lengths are those of the user's meshes: option --unit
  std::vector<std::string> table{};  ///< columns of the printed table, without --stages; empty: all
  std::function<void(CLI::App&)> addOptions{};
  std::function<std::unique_ptr<LiveScene>(int threads)> make{};
};

/// main() of a scene: reads the command line, computes the frames, prints times beside budgets,
/// writes frames.csv, report.html and, with a display, scene.png.
///
/// Returns  the exit code (CommandLine.h). If it is not 0, one sentence gives the reason, and
///          nothing is written.
int runScene(const SceneProgram&, int count, char** arguments);

/// Throws Error if the file cannot be used, or if the program was built without mesh files.
SceneMesh readMesh(const std::filesystem::path&);

}  // namespace palpate::scenes
