#pragma once

#include <palpate/CollisionData.h>
#include <palpate/Export.h>
#include <palpate/LooseOctree.h>
#include <palpate/Types.h>

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace palpate::vtk {

/// What to draw: translucent bodies, octree cells as green wireframe (the deeper the brighter),
/// each contact as a small orange sphere midway between its two closest points. All of it stays
/// with the caller.
struct Picture {
  struct Contacts {
    std::size_t a, b;  ///< of bodies, in the pair's order
    const CollisionData* data;
  };
  std::vector<TriangleMeshView> bodies;
  std::vector<Contacts> contacts;
  const LooseOctree* octree = nullptr;
  int width = 1280, height = 960;  ///< pixels, [1, 16384]
};

struct Image {
  int width = 0, height = 0;
  std::vector<std::uint8_t> rgb;  ///< rows from the bottom up
};

/// Draws off screen, seen from a fixed direction with all bodies in view.
///
/// Errors   ErrorCode::InvalidSettings: size out of range, a contact of no body; ErrorCode::NotAvailable: no
///          display to draw with (without a screen, run the program under xvfb-run).
PALPATE_EXPORT Image draw(const Picture&);

/// The content of a PNG file.
PALPATE_EXPORT std::string toPng(const Image&);

}  // namespace palpate::vtk
