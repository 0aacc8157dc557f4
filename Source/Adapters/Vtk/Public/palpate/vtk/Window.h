#pragma once

#include <palpate/Export.h>
#include <palpate/OctreeBasedCD.h>

#include <Eigen/Core>

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace palpate::vtk {

/// A picture of width times height pixels.
struct Image {
  int width = 0, height = 0;
  std::vector<std::uint8_t> rgb;  ///< three bytes per pixel; rows from the bottom up
};

/// Encodes an image as the content of a PNG file.
PALPATE_EXPORT std::string toPng(const Image&);

/// Opens a connection to the X display and keeps it as long as the result exists. VTK ends the
/// program if it cannot open a display; a Window therefore calls this first. An X server such as
/// Xvfb restarts when its last client leaves, and refuses connections for a moment; the call waits
/// for it.
///
/// Errors   NotAvailable if there is no display.
PALPATE_EXPORT std::shared_ptr<void> openDisplay();

/// How a window draws a geometry or a part of it.
struct Appearance {
  std::string label{};                             ///< a name in the picture; empty: none
  std::array<double, 3> colour{0.62, 0.66, 0.72};  ///< red, green and blue in [0, 1]
  double opacity = 1;                              ///< in [0, 1]; 0: invisible
  /// false: draws only faces that point away from the camera, so that you see into a cavity
  bool frontFaces = true;
};

/// The direction and the part of the scene that a window shows. The projection is parallel: a
/// length has the same size everywhere in the picture.
struct View {
  Eigen::Vector3d from{0.5, -1.0, 0.6};              ///< from the scene to the camera; any length
  Eigen::Vector3d up{0, 0, 1};                       ///< not parallel to `from`
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();  ///< used if `height` is positive
  double height = 0;  ///< L: the height of the picture; 0: everything is in view
};

/// A window that shows the geometries of an OctreeBasedCD and its last answers:
/// - bodies and tools, with their names, if setAppearance() gave them any
/// - contacts, midway between their two points, and their normals, coloured by distance; they shine
///   through the bodies that hide them
/// - vertices that validity() names, in magenta
/// - octree cells, in green, on demand
/// - a bar of a round length, and a bar of the colours of distances
/// - a panel with the frame rate, contacts, times and validity, and a graph of the times
///
/// The mouse turns the view. A click names the element under the cursor.
///
///   palpate::vtk::Window window(collisions);
///   while (window.show()) {
///     moveAndDetect(collisions);  // a frame
///   }
///
/// Keys     o: the cells of the contact nearest to the camera, all cells by depth, all cells by
///          occupancy, none; b: bodies solid or translucent; c: contacts; n: normals; u: untrusted
///          elements; l: names; p: panel; t: times; r: all in view; space: waits until it is
///          pressed again; q: closes.
/// Needs    the OctreeBasedCD must stay at its address while the window exists. From show() to
///          press() and pick() only its positions and transforms may change.
/// Errors   the constructor throws NotAvailable if there is no display, which it also needs to draw
///          off screen: run the program under xvfb-run. It throws InvalidSettings for a size
///          outside [1, 16384] pixels.
/// Threads  make all calls from the thread that made the window.
class PALPATE_EXPORT Window {
 public:
  /// width, height: pixels. onScreen: false draws off screen, for image(), without panel and graph
  /// until their keys are pressed.
  explicit Window(const OctreeBasedCD&, bool onScreen = true, int width = 1280, int height = 960);
  ~Window();
  /// Sets how the next show() draws a geometry, from the element `firstElement` up to the first
  /// element of the geometry's next part. The opacity and the faces of element 0 apply to all
  /// parts. Ids of geometries that do not exist have no effect.
  ///
  /// Errors   InvalidSettings for a value outside its range.
  void setAppearance(GeometryId, const Appearance&, std::uint32_t firstElement = 0);
  /// Aims the camera at the next show(). Without this call, everything in the first frame is in
  /// view.
  ///
  /// Errors   InvalidSettings for values that are not finite, directions of length 0 or parallel to
  ///          each other, and a negative height.
  void setView(const View&);
  void setLengthUnit(std::string);  ///< the name of L in the picture, such as "mm"
  /// Draws the last frame and handles keys and mouse. Returns false after the window was closed.
  bool show();
  void press(char key);  ///< does what the key does
  /// Does what a click does, at pixels from the bottom left. Returns the element's name, such as
  /// "geometry 2, triangle 417", or nothing.
  std::string pick(int x, int y);
  Image image() const;  ///< the picture that the window shows

 private:
  struct Implementation;
  std::unique_ptr<Implementation> m_implementation;
};

}  // namespace palpate::vtk
