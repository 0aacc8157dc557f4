#pragma once

#include <palpate/Export.h>
#include <palpate/OctreeBasedCD.h>

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

/// A window that shows the geometries of an OctreeBasedCD and its last answers. It shows bodies and
/// tools (translucent); octree cells (green); contacts, midway between their two points, and their
/// normals, coloured by distance (red: near); vertices that validity() names (magenta); the times
/// of the stages as a graph. The mouse turns the view. A click names the element under the cursor.
///
///   palpate::vtk::Window window(collisions);
///   while (window.show()) {
///     moveAndDetect(collisions);  // a frame
///   }
///
/// Keys     o: cells by depth, by occupancy, none; c: contacts; n: normals; u: untrusted elements;
///          t: times; r: all in view; space: waits until it is pressed again; q: closes.
/// Needs    the OctreeBasedCD must stay at its address while the window exists. From show() to
///          press() and pick() only its positions and transforms may change.
/// Errors   the constructor throws NotAvailable if there is no display, which it also needs to draw
///          off screen: run the program under xvfb-run. It throws InvalidSettings for a size
///          outside [1, 16384] pixels.
/// Threads  make all calls from the thread that made the window.
class PALPATE_EXPORT Window {
 public:
  /// width, height: pixels. onScreen: false draws off screen, for image().
  explicit Window(const OctreeBasedCD&, bool onScreen = true, int width = 1280, int height = 960);
  ~Window();
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
