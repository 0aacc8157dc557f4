#pragma once

#include <palpate/Export.h>
#include <palpate/OctreeBasedCD.h>

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace palpate::vtk {

struct Image {
  int width = 0, height = 0;
  std::vector<std::uint8_t> rgb;  ///< rows from the bottom up
};

/// The content of a PNG file.
PALPATE_EXPORT std::string toPng(const Image&);

/// A connection to the display. VTK ends the program where it cannot open one, so this is asked for
/// first, and kept as long as VTK draws: an X server such as Xvfb starts anew when its last client
/// leaves, and for a moment takes nobody.
///
/// Errors   ErrorCode::NotAvailable: there is none.
PALPATE_EXPORT std::shared_ptr<void> openDisplay();

/// What an OctreeBasedCD was given and answers: bodies and tools, translucent; cells in green;
/// contacts midway of their two points, and their normals, coloured by distance (red: near);
/// vertices that validity() names, in magenta; the stages' times as a graph. The mouse turns the
/// view, a click names the element under the cursor.
///
///   palpate::vtk::Window window(collisions);
///   while (window.show()) {
///     moveAndDetect(collisions);  // a frame
///   }
///
/// Keys     o: cells by depth, by occupancy, none; c: contacts; n: normals; u: untrusted elements;
///          t: times; r: all in view; space: waits; q: closes.
/// Errors   ErrorCode::NotAvailable: no display to draw with, on screen or off (without a screen,
///          run the program under xvfb-run). InvalidSettings: a size out of [1, 16384] pixels.
/// Needs    the OctreeBasedCD stays where it is, and as it is but for positions and transforms from
///          show() to press() and pick().
/// Threads  all calls from the thread that made it.
class PALPATE_EXPORT Window {
 public:
  explicit Window(const OctreeBasedCD&, bool onScreen = true, int width = 1280, int height = 960);
  ~Window();
  /// Draws the last frame and answers keys and mouse. False once closed.
  bool show();
  void press(char key);  ///< as the key does
  /// As a click there does, pixels from the bottom left: "geometry 2, triangle 417", or nothing.
  std::string pick(int x, int y);
  Image image() const;  ///< what is shown

 private:
  struct Implementation;
  std::unique_ptr<Implementation> m_implementation;
};

}  // namespace palpate::vtk
