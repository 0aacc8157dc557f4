#pragma once

#include <palpate/Export.h>
#include <palpate/OctreeBasedCD.h>

#include <Eigen/Core>

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace palpate::vtk {

struct Image {
  int width = 0, height = 0;
  std::vector<std::uint8_t> rgb;  ///< three bytes per pixel; rows from the bottom up
};

PALPATE_EXPORT std::string toPng(const Image&);  ///< the content of a file

/// Keeps a connection to the X display while the result exists, and waits for a server that
/// restarts. A Window calls it first. Throws NotAvailable without a display.
PALPATE_EXPORT std::shared_ptr<void> openDisplay();

struct Appearance {
  std::string label{};                             ///< a name in the picture; empty: none
  std::array<double, 3> colour{0.62, 0.66, 0.72};  ///< red, green and blue in [0, 1]
  double opacity = 1;                              ///< in [0, 1]; 0: invisible
  bool frontFaces = true;                          ///< false: only faces away from the camera
  double roughness = 0.4;                          ///< in [0, 1]; 0: a mirror
  double metallic = 0;                             ///< in [0, 1]; 1: metal
  bool isCut = true;                               ///< false: a section leaves the body whole
};

/// An enlarged part of the scene, seen from the same direction.
struct Inset {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  double height = 1;              ///< L, of the part
  bool left = false, top = true;  ///< the corner of the picture
};

/// A text in the picture, and an arrow, both in front of all bodies.
struct Note {
  std::string text{};
  Eigen::Vector3d at = Eigen::Vector3d::Zero();  ///< the arrow's tip, or the text's middle
  std::optional<Eigen::Vector3d> from{};         ///< the arrow's other end; its text stands there
  std::array<double, 3> colour{0.1, 0.1, 0.12};
};

/// The direction and the part of the scene. The projection is parallel.
struct View {
  Eigen::Vector3d from{0.5, -1.0, 0.6};              ///< from the scene to the camera; any length
  Eigen::Vector3d up{0, 0, 1};                       ///< not parallel to `from`
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();  ///< used if `height` is positive
  double height = 0;  ///< L: the height of the picture; 0: everything is in view
};

/// A window that shows the geometries of an OctreeBasedCD and its last answers. Contacts are midway
/// between their points, with normals, coloured by distance: white at 0 if any is negative. The
/// range of colours only grows. Vertices of validity() are magenta.
///
///   palpate::vtk::Window window(collisions);
///   while (window.show()) moveAndDetect(collisions);  // a frame
///
/// Keys     Docs/Scenes.md lists them. The mouse turns the view; a click names an element.
/// Needs    an OctreeBasedCD that stays at its address. From show() to press() and pick() only its
///          positions and transforms may change. Make all calls from one thread.
/// Errors   NotAvailable without a display, also off screen; InvalidSettings beyond 16384 pixels.
class PALPATE_EXPORT Window {
 public:
  /// Pixels. onScreen: false draws for image() only, at first without panel and graph.
  explicit Window(const OctreeBasedCD&, bool onScreen = true, int width = 1280, int height = 960);
  ~Window();
  /// For the next show(), from `firstElement` up to the next part's. Opacity and faces of element 0
  /// apply to all parts. Unknown ids have no effect. InvalidSettings for a value outside its range.
  void setAppearance(GeometryId, const Appearance&, std::uint32_t firstElement = 0);
  /// For the next show(); by default everything in the first frame is in view. Throws
  /// InvalidSettings if not finite, for parallel directions or length 0, or height < 0.
  void setView(const View&);
  /// Shows an enlarged part of the scene in a corner, and frames it in the picture. Throws
  /// InvalidSettings if not finite, or if the height is not positive.
  void setInset(const Inset&);
  /// Shows only bodies and contacts in the half-space of a plane. Throws InvalidSettings if the
  /// plane is not finite or has no normal.
  void setSection(const Plane&);
  void setNotes(std::vector<Note>);  ///< for the next show(); without an effect if not finite
  void setLengthUnit(std::string);   ///< the name of L in the picture, such as "mm"
  /// Draws the last frame and handles input; false once closed. frame: its number in the panel and
  /// the title; negative: one more than before, from 0.
  bool show(int frame = -1);
  void press(char key);          ///< does what the key does; a text in the picture if it has none
  static bool hasKey(char key);  ///< whether a key does something
  /// Does what a click does, at pixels from the bottom left; names the element or nothing.
  std::string pick(int x, int y);
  Image image() const;  ///< the picture that the window shows

 private:
  struct Implementation;
  std::unique_ptr<Implementation> m_implementation;
};

}  // namespace palpate::vtk
