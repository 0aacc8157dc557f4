#include "Scenes.h"

#include <palpate/Palpate.h>
#include <palpate/vtk/Picture.h>

#include <gtest/gtest.h>

#include <cstdlib>

namespace palpate::vtk {
namespace {

using Eigen::Vector3d;

struct Pixel {
  int red, green, blue;
  bool isWhite() const { return red == 255 && green == 255 && blue == 255; }
  bool isGreen() const { return green > red + 30 && green > blue + 30; }
  bool isOrange() const { return red > 180 && green > 80 && green < red - 40 && blue < 60; }
  bool isFlesh() const { return !isWhite() && !isGreen() && !isOrange() && red > 60 && blue > 60; }
};

Pixel pixel(const Image& image, int x, int y) {
  const std::size_t at = 3 * (static_cast<std::size_t>(y) * image.width + x);
  return {image.rgb[at], image.rgb[at + 1], image.rgb[at + 2]};
}

std::size_t count(const Image& image, bool (Pixel::*question)() const) {
  std::size_t found = 0;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) found += (pixel(image, x, y).*question)();
  }
  return found;
}

/// The organs at a frame in which they touch.
class Picture : public testing::Test {
 protected:
  Picture() : scene(scenes::organs()) {
    for (std::size_t m = 0; m < scene.meshes.size(); ++m) {
      scene.positions(24, m, scene.meshes[m].positions);
      ids.push_back(
          detection.addTriangleMesh(scene.meshes[m].positions, scene.meshes[m].triangles));
      picture.bodies.push_back({scene.meshes[m].positions, scene.meshes[m].triangles});
    }
    for (const auto& [a, b] : scene.pairs) {
      detection.addCollisionPair(ids[a], ids[b], {.thickness = scene.thickness});
    }
    detection.detectCollision();
    picture.width = 640;
    picture.height = 480;
  }

  void addContacts() {
    for (const auto& [a, b] : scene.pairs) {
      picture.contacts.push_back({a, b, &detection.collisionData(ids[a], ids[b])});
    }
  }

  scenes::Scene scene;
  OctreeBasedCD detection;
  std::vector<GeometryId> ids;
  vtk::Picture picture;
};

TEST_F(Picture, ShowsOrgansCellsAndContacts) {
  const Image bodies = draw(picture);
  ASSERT_EQ(bodies.rgb.size(), 640u * 480 * 3);
  const std::size_t all = 640 * 480, flesh = count(bodies, &Pixel::isFlesh);
  EXPECT_GT(flesh, all / 8);
  EXPECT_GT(count(bodies, &Pixel::isWhite), all / 8);
  EXPECT_EQ(count(bodies, &Pixel::isGreen), 0u);
  EXPECT_EQ(count(bodies, &Pixel::isOrange), 0u);
  for (int x = 0; x < 640; ++x) {  // nothing cut off
    for (const int y : {0, 479}) EXPECT_TRUE(pixel(bodies, x, y).isWhite());
  }
  for (int y = 0; y < 480; ++y) {
    for (const int x : {0, 639}) EXPECT_TRUE(pixel(bodies, x, y).isWhite());
  }

  addContacts();
  const Image contacts = draw(picture);
  EXPECT_GT(count(contacts, &Pixel::isOrange), 100u);
  EXPECT_EQ(count(contacts, &Pixel::isGreen), 0u);

  const LooseOctree octree = detection.octree();
  picture.octree = &octree;
  const Image cells = draw(picture);
  EXPECT_GT(count(cells, &Pixel::isGreen), all / 50);
  EXPECT_GT(count(cells, &Pixel::isOrange), 100u);
  EXPECT_GT(count(cells, &Pixel::isFlesh), all / 20);
}

TEST_F(Picture, ContactLiesBetweenItsFeatures) {
  // Two tips that all but meet in the middle of the picture.
  const std::vector<Vector3d> up{{-1, -1, -1}, {1, -1, -1}, {0, 1, -1}, {0, 0, -0.01}};
  const std::vector<Vector3d> down{{-1, -1, 1}, {0, 1, 1}, {1, -1, 1}, {0, 0, 0.01}};
  const std::vector<Triangle> sides{{0, 1, 3}, {1, 2, 3}, {2, 0, 3}};
  const TriangleMeshView a{up, sides}, b{down, sides};
  const CollisionData data = detectCollision(a, b, {.thickness = 0.05});
  ASSERT_FALSE(data.vertexTriangle().empty());
  vtk::Picture tips{{a, b}, {}, nullptr, 200, 200};
  EXPECT_FALSE(pixel(draw(tips), 100, 100).isOrange());
  tips.contacts = {{0, 1, &data}};
  const Image image = draw(tips);
  EXPECT_TRUE(pixel(image, 100, 100).isOrange());
  EXPECT_LT(count(image, &Pixel::isOrange), 200u);
}

TEST_F(Picture, OfNothingIsWhite) {
  const Image image = draw({{}, {}, nullptr, 20, 10});
  EXPECT_EQ(count(image, &Pixel::isWhite), 200u);
}

TEST_F(Picture, RefusesSizesAndContactsThatCannotBe) {
  const auto refused = [](const vtk::Picture& wrong) {
    try {
      draw(wrong);
      return false;
    } catch (const Error& error) {
      return error.code() == ErrorCode::InvalidSettings;
    }
  };
  const CollisionData none;
  EXPECT_TRUE(refused({{}, {}, nullptr, 0, 10}));
  EXPECT_TRUE(refused({{}, {}, nullptr, 10, 20'000}));
  EXPECT_TRUE(refused({{}, {{0, 0, &none}}, nullptr, 10, 10}));
}

TEST_F(Picture, BecomesPng) {
  const std::string png = toPng(draw(picture));
  EXPECT_TRUE(png.starts_with("\x89PNG\r\n\x1a\n"));
  EXPECT_TRUE(png.ends_with("IEND\xae\x42\x60\x82"));
  EXPECT_GT(png.size(), 5'000u);
}

TEST(NoDisplay, IsSaidAndNotTheEnd) {
  ASSERT_EQ(std::getenv("DISPLAY"), nullptr);
  try {
    draw({});
    ADD_FAILURE() << "drawn without a display";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::NotAvailable);
    EXPECT_NE(std::string(error.what()).find("xvfb-run"), std::string::npos);
  }
}

}  // namespace
}  // namespace palpate::vtk
