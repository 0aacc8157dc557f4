#include <palpate/vtk/Window.h>
#include "Common/ExpectRefused.h"
#include "Scenes.h"

#include <palpate/Palpate.h>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <numeric>

namespace palpate::vtk {
namespace {

using Eigen::Vector3d;
using palpate::testing::expectRefused;

struct Pixel {
  int red, green, blue;
  friend bool operator==(const Pixel&, const Pixel&) = default;
  bool isWhite() const { return red == 255 && green == 255 && blue == 255; }
  bool isGreen() const { return green > red + 60 && green > blue + 60; }
  bool isMagenta() const { return red > green + 120 && blue > green + 120; }
  /// The colour of a contact: violet to green to yellow. Bodies are reddish or pale.
  bool isVivid() const {
    return std::max(green, blue) > red + 25 || (std::min(red, green) > 140 && blue < 90);
  }
};

Pixel pixel(const Image& image, int x, int y) {
  const std::size_t at = 3 * (static_cast<std::size_t>(y) * image.width + x);
  return {image.rgb[at], image.rgb[at + 1], image.rgb[at + 2]};
}

/// Of the pixels above the bars of length and colours, or of all.
std::size_t count(const Image& image, bool (Pixel::*question)() const, bool all = true) {
  std::size_t found = 0;
  for (int y = all ? 0 : image.height / 7; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) found += (pixel(image, x, y).*question)();
  }
  return found;
}

struct Differences {
  std::size_t inside = 0, outside = 0;
};

/// The pixels in which two pictures differ, by whether isInside(x, y) holds.
template <class F>
Differences differencesOf(const Image& a, const Image& b, F&& isInside) {
  Differences found;
  for (int y = 0; y < a.height; ++y)
    for (int x = 0; x < a.width; ++x)
      if (pixel(a, x, y) != pixel(b, x, y)) ++(isInside(x, y) ? found.inside : found.outside);
  return found;
}

/// The organs at a frame in which they touch.
class WindowOnOrgans : public ::testing::Test {
 protected:
  WindowOnOrgans() : scene(scenes::organs()) {
    for (std::size_t m = 0; m < scene.meshes.size(); ++m) {
      scene.positions(24, m, scene.meshes[m].positions);
      const auto& mesh = scene.meshes[m];
      ids.push_back(detection.addTriangleMesh(mesh.positions, mesh.triangles));
    }
    for (const auto& [a, b] : scene.pairs)
      detection.addCollisionPair(ids[a], ids[b], {.thickness = scene.thickness});
    detection.detectCollision();
  }

  scenes::Scene scene;
  OctreeBasedCD detection;
  std::vector<GeometryId> ids;
};

TEST_F(WindowOnOrgans, KeysToggleWhatIsShown) {
  Window window(detection, false, 320, 240);
  EXPECT_TRUE(window.show());
  const Image all = window.image();
  ASSERT_EQ(all.rgb.size(), 320u * 240 * 3);
  EXPECT_GT(count(all, &Pixel::isWhite), 320u * 240 / 8);
  EXPECT_LT(count(all, &Pixel::isWhite), 320u * 240 * 7 / 8);
  window.press('n');
  window.press('c');
  const Image bodies = window.image();
  EXPECT_EQ(count(bodies, &Pixel::isGreen), 0u);
  for (int x = 0; x < 320; ++x)  // nothing cut off
    for (const int y : {0, 239}) EXPECT_TRUE(pixel(bodies, x, y).isWhite());
  window.press('o');
  const std::size_t cellsOfContact = count(window.image(), &Pixel::isGreen);
  EXPECT_GT(cellsOfContact, 20u);
  window.press('o');
  const Image byDepth = window.image();
  EXPECT_GT(count(byDepth, &Pixel::isGreen), 2 * cellsOfContact);
  EXPECT_GT(count(byDepth, &Pixel::isGreen), 320u * 240 / 50);
  window.press('o');
  const Image byOccupancy = window.image();
  EXPECT_GT(count(byOccupancy, &Pixel::isGreen), 320u * 240 / 100);
  EXPECT_NE(byDepth.rgb, byOccupancy.rgb);
  window.press('o');
  EXPECT_EQ(window.image().rgb, bodies.rgb);
}

TEST_F(WindowOnOrgans, FiveLinesShowEachFrameWithItsTimes) {
  Window window(detection, true, 320, 240);
  int frames = 0;
  while (window.show()) {
    for (std::size_t m = 0; m < ids.size(); ++m) {
      std::vector<Vector3d> moved = scene.meshes[m].positions;
      for (Vector3d& p : moved) p.x() += 0.001 * frames * static_cast<double>(m);
      detection.setPositions(ids[m], moved);
    }
    detection.detectCollision();
    if (++frames == 4) window.press('q');
  }
  EXPECT_EQ(frames, 4);
  const Image graph = window.image();
  window.press('t');
  const Image without = window.image();
  const auto [inside, outside] =
      differencesOf(graph, without, [](int x, int y) { return x >= 198 && y < 77; });
  EXPECT_GT(inside, 500u);
  EXPECT_EQ(outside, 0u);
}

TEST_F(WindowOnOrgans, PanelAndNamesAreShownOnDemand) {
  Window window(detection, false, 640, 480);
  window.show();
  const Image without = window.image();
  window.press('p');
  const Image panel = window.image();
  const auto [inside, outside] =
      differencesOf(panel, without, [](int x, int y) { return x < 320 && y > 240; });
  EXPECT_GT(inside, 500u);
  EXPECT_EQ(outside, 0u);
  window.press('p');
  EXPECT_EQ(window.image().rgb, without.rgb);
  window.setAppearance(ids[0], {.label = "Liver"});
  window.show();
  const Image named = window.image();
  window.press('l');
  EXPECT_NE(window.image().rgb, named.rgb);
}

TEST_F(WindowOnOrgans, PanelHasTheFramesNumber) {
  Window window(detection, false, 640, 480);
  window.press('p');
  const auto changes = [&](int frame, const Image& than) {  // of the panel's first line
    window.show(frame);
    return differencesOf(window.image(), than, [](int x, int y) { return x < 320 && y >= 466; })
        .inside;
  };
  window.show();  // 0
  const Image first = window.image();
  EXPECT_GT(changes(170, first), 10u);
  EXPECT_EQ(changes(0, first), 0u);
  EXPECT_GT(changes(-1, first), 0u);  // 1
}

TEST_F(WindowOnOrgans, UnknownKeysAreReported) {
  Window window(detection, false, 320, 240);
  window.show();
  const Image image = window.image();
  EXPECT_FALSE(Window::hasKey('x'));
  window.press('x');
  EXPECT_NE(window.image().rgb, image.rgb);
  EXPECT_TRUE(Window::hasKey('n'));
  window.press('n');
  window.press('n');
  EXPECT_EQ(window.image().rgb, image.rgb);
}

TEST(Window, AppearanceAndViewAreHonoured) {
  const scenes::SceneMesh ball = scenes::sphere(6);
  OctreeBasedCD detection;
  const GeometryId id = detection.addTriangleMesh(ball.positions, ball.triangles);
  Window window(detection, false, 200, 200);
  window.setAppearance(id, {.colour = {0.1, 0.1, 0.9}});
  window.setView({.from = {1, 0, 0}, .height = 4});
  window.show();
  Image image = window.image();  // a disc whose diameter is half the height
  EXPECT_FALSE(pixel(image, 100, 145).isWhite());
  EXPECT_TRUE(pixel(image, 100, 155).isWhite());
  EXPECT_GT(pixel(image, 100, 100).blue, pixel(image, 100, 100).red + 60);
  window.setAppearance(id, {.colour = {0.1, 0.9, 0.1}}, 1);  // all triangles but the first
  window.show();
  EXPECT_GT(pixel(window.image(), 100, 100).green, pixel(window.image(), 100, 100).blue + 60);
  window.setSection({});  // the lower half
  window.show();
  EXPECT_TRUE(pixel(window.image(), 100, 130).isWhite());
  EXPECT_FALSE(pixel(window.image(), 100, 70).isWhite());
  window.setAppearance(id, {.isCut = false});
  window.show();
  EXPECT_FALSE(pixel(window.image(), 100, 130).isWhite());
  window.setAppearance(id, {.opacity = 0});
  window.show();
  EXPECT_TRUE(pixel(window.image(), 100, 100).isWhite());
  EXPECT_EQ(window.pick(100, 100), "");
}

TEST(Window, RefusesAppearancesAndViewsOutOfRange) {
  const OctreeBasedCD nothing;
  Window window(nothing, false, 20, 20);
  const auto refuse = [](auto&& call) { expectRefused(ErrorCode::InvalidSettings, "", call); };
  const double nan = std::nan("");
  for (const double wrong : {-0.1, 1.1, nan}) {
    refuse([&] { window.setAppearance({}, {.opacity = wrong}); });
    refuse([&] { window.setAppearance({}, {.colour = {0, wrong, 0}}); });
  }
  for (const View& wrong : {View{.from = {0, 0, 0}}, View{.from = {0, 0, 2}},
                            View{.from = {nan, 0, 1}}, View{.height = -1}, View{.height = nan}})
    refuse([&] { window.setView(wrong); });
  for (const Inset& wrong :
       {Inset{.centre = {nan, 0, 0}}, Inset{.height = 0}, Inset{.height = nan}})
    refuse([&] { window.setInset(wrong); });
  for (const Plane& wrong : {Plane{.point = {nan, 0, 0}}, Plane{.normal = {0, 0, 0}}})
    refuse([&] { window.setSection(wrong); });
}

/// Where the middle of the picture looks: from the front, somewhat to the right and above.
const Vector3d kBack = Vector3d(0.5, -1.0, 0.6).normalized();
/// The origin is in the middle.
const View kCentred{.height = 4};

TEST(Window, PickNamesTheElementUnderTheCursor) {
  const scenes::SceneMesh ball = scenes::sphere(6);
  const std::vector<Vector3d> line{-0.3 * kBack.unitOrthogonal() + 1.5 * kBack,
                                   0.7 * kBack.unitOrthogonal() + 1.5 * kBack,
                                   2 * kBack.unitOrthogonal()};
  OctreeBasedCD detection;
  detection.addTriangleMesh(ball.positions, ball.triangles);
  {
    Window window(detection, true, 300, 300);
    window.setView(kCentred);
    window.show();
    const std::string picked = window.pick(150, 150), start = "geometry 0, triangle ";
    ASSERT_TRUE(picked.starts_with(start)) << picked;
    const auto& [a, b, c] = ball.triangles.at(std::stoul(picked.substr(start.size())));
    Eigen::Matrix3d corners;  // the ray from the middle leaves through the triangle
    corners << ball.positions[a], ball.positions[b], ball.positions[c];
    EXPECT_GT(corners.inverse().operator*(kBack).minCoeff(), -0.02) << picked;
    EXPECT_EQ(window.pick(2, 2), "");
  }
  const GeometryId tool = detection.addAnalyticalGeometry(Sphere{Vector3d::Zero(), 1.2});
  detection.setTransform(tool, {Eigen::Matrix3d::Identity(), Vector3d::Zero()});
  Window window(detection, false, 300, 300);
  window.setView(kCentred);
  window.show();
  EXPECT_EQ(window.pick(150, 150), "geometry 1, a shape");
}

TEST(Window, CutMeshesAreDrawnAsMeshesWithoutTheRemovedTriangles) {
  scenes::SceneMesh ball = scenes::sphere(2);
  ball.triangles.push_back({0, 1, 1});  // without area
  const auto imageOf = [](const OctreeBasedCD& detection) {
    Window window(detection, false, 100, 100);
    window.show();
    return window.image().rgb;
  };
  OctreeBasedCD whole, cut, anew;
  whole.addTriangleMesh(ball.positions, ball.triangles);
  const GeometryId id = cut.addTriangleMesh(ball.positions, ball.triangles);
  std::vector<std::uint32_t> removed(40);
  std::iota(removed.begin(), removed.end(), 0u);
  cut.replaceTriangles(id, removed, {}, {});
  ball.triangles.erase(ball.triangles.begin(), ball.triangles.begin() + 40);
  anew.addTriangleMesh(ball.positions, ball.triangles);
  EXPECT_EQ(imageOf(cut), imageOf(anew));
  EXPECT_NE(imageOf(cut), imageOf(whole));
}

TEST(Window, DrawsEveryGeometryTypeAtItsPlace) {
  // A thread, points and each shape, one at a time, about the middle of an open frame of specks.
  const std::vector<Vector3d> frame{{-1, -1, -1}, {1, 1, 1}};
  const std::vector<AnalyticalGeometry> shapes{
      Sphere{{5, 0, 0}, 0.5},
      Capsule{{4.7, 0, 0}, {5.3, 0, 0}, 0.3},
      Plane{{5, 0, 0}, {1, 0, 0}},
      Box{{5, 0, 0}, {0.5, 0.4, 0.3}},
      Cylinder{{5, 0, -0.5}, {5, 0, 0.5}, 0.4},
      ConvexHull{{{4.5, 0, 0}, {5.5, 0, 0}, {5, 0.5, 0}, {5, 0, 0.5}, {5, -0.5, -0.5}}}};
  for (const AnalyticalGeometry& shape : shapes) {
    OctreeBasedCD detection;
    detection.addPointSet(frame, 0.01);
    const GeometryId id = detection.addAnalyticalGeometry(shape);
    detection.setTransform(id, {Eigen::Matrix3d::Identity(), {-5, 0, 0}});
    Window window(detection, false, 200, 200);
    window.setView(kCentred);
    window.show();
    EXPECT_EQ(window.pick(100, 100), "geometry 1, a shape") << shape.index();
    EXPECT_FALSE(pixel(window.image(), 100, 100).isWhite()) << shape.index();
  }
  OctreeBasedCD detection;
  detection.addPointSet(frame, 0.01);
  detection.addLineMesh(std::vector<Vector3d>{{-1, -1, 1}, {-0.5, -0.5, 0.5}, {1, 1, -1}},
                        std::vector<Segment>{{0, 1}, {1, 2}}, 0.1);
  detection.addPointSet(std::vector<Vector3d>{{9, 9, 9}, 0.5 * kBack});
  Window window(detection, false, 200, 200);
  window.show();
  EXPECT_FALSE(count(window.image(), &Pixel::isWhite) == 200u * 200);
}

TEST(Window, ContactLiesBetweenItsFeatures) {
  // Two tips that all but meet in the middle of the picture.
  const std::vector<Vector3d> up{{-1, -1, -1}, {1, -1, -1}, {0, 1, -1}, {0, 0, -0.01}};
  const std::vector<Vector3d> down{{-1, -1, 1}, {0, 1, 1}, {1, -1, 1}, {0, 0, 0.01}};
  const std::vector<Triangle> sides{{0, 1, 3}, {1, 2, 3}, {2, 0, 3}};
  OctreeBasedCD detection;
  const GeometryId a = detection.addTriangleMesh(up, sides),
                   b = detection.addTriangleMesh(down, sides);
  detection.addCollisionPair(a, b, {.thickness = 0.05});
  detection.detectCollision();
  Window window(detection, false, 200, 200);
  window.setView({.height = 1});
  window.show();
  window.press('n');
  EXPECT_TRUE(pixel(window.image(), 100, 100).isVivid());
  EXPECT_LT(count(window.image(), &Pixel::isVivid, false), 200u);
  window.setSection({.point = {0, 0, -0.5}});
  window.show();
  EXPECT_EQ(count(window.image(), &Pixel::isVivid, false), 0u);
  window.setSection({.point = {0, 0, 0.5}});
  window.show();
  EXPECT_TRUE(pixel(window.image(), 100, 100).isVivid());
  window.press('c');
  EXPECT_FALSE(pixel(window.image(), 100, 100).isVivid());
}

TEST(Window, KeysToggleContactsAndNormals) {
  scenes::SceneMesh upper = scenes::sheet(4);
  const scenes::SceneMesh lower = scenes::sheet(4);
  for (Vector3d& p : upper.positions) p.z() += 0.04;
  OctreeBasedCD detection;
  const GeometryId a = detection.addTriangleMesh(upper.positions, upper.triangles),
                   b = detection.addTriangleMesh(lower.positions, lower.triangles);
  detection.addCollisionPair(a, b, {.thickness = 0.05});
  detection.detectCollision();
  Window window(detection, false, 320, 240);
  window.setAppearance(a, {.opacity = 0});  // the contacts are seen
  window.show();
  const auto vivid = [&] { return count(window.image(), &Pixel::isVivid, false); };
  const std::size_t all = vivid();
  window.press('n');
  const std::size_t spheres = vivid();
  window.press('c');
  const std::size_t bodies = vivid();
  EXPECT_GT(all, spheres);
  EXPECT_GT(spheres, bodies + 20);
}

TEST(Window, MarksUntrustedContacts) {
  scenes::SceneMesh upper = scenes::sheet(4), lower = scenes::sheet(4);
  for (Vector3d& p : upper.positions) p.z() += 0.1;
  OctreeBasedCD detection;
  const GeometryId a = detection.addTriangleMesh(upper.positions, upper.triangles),
                   b = detection.addTriangleMesh(lower.positions, lower.triangles);
  detection.addCollisionPair(a, b, {.method = Method::Proximity, .thickness = 0.05});
  detection.detectCollision();
  detection.advance();
  for (Vector3d& p : upper.positions)
    p.z() = -0.04;  // through the other, further than the thickness
  detection.setPositions(a, upper.positions);
  detection.detectCollision();
  ASSERT_FALSE(detection.collisionData(a, b).validity().untrustedVerticesA.empty());
  Window window(detection, false, 300, 300);
  window.show();
  window.press('c');
  window.press('n');
  EXPECT_GT(count(window.image(), &Pixel::isMagenta), 50u);
  window.press('u');
  EXPECT_EQ(count(window.image(), &Pixel::isMagenta), 0u);
}

TEST(Window, EmptySceneIsWhiteAndBadSizesAreRefused) {
  const OctreeBasedCD nothing;
  Window window(nothing, false, 200, 100);
  window.show();
  EXPECT_EQ(count(window.image(), &Pixel::isWhite), 200u * 100);
  for (const auto& [width, height] : {std::pair(0, 10), {10, 20'000}}) {
    expectRefused(ErrorCode::InvalidSettings, "",
                  [&, &w = width, &h = height] { Window(nothing, false, w, h); });
  }
}

TEST_F(WindowOnOrgans, WritesPng) {
  Window window(detection, false, 320, 240);
  window.show();
  const std::string png = toPng(window.image());
  EXPECT_TRUE(png.starts_with("\x89PNG\r\n\x1a\n"));
  EXPECT_TRUE(png.ends_with("IEND\xae\x42\x60\x82"));
  EXPECT_GT(png.size(), 5'000u);
}

TEST(NoDisplay, ThrowsAndTheProgramGoesOn) {
  ASSERT_EQ(std::getenv("DISPLAY"), nullptr);
  const OctreeBasedCD nothing;
  for (const char* name : {static_cast<const char*>(nullptr), "", ":no"}) {
    if (name != nullptr) setenv("DISPLAY", name, 1);
    const bool onScreen = name != nullptr;
    expectRefused(ErrorCode::NotAvailable, "xvfb-run", [&] { Window(nothing, onScreen); });
  }
}

}  // namespace
}  // namespace palpate::vtk
