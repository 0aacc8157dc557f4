#include "SpatialBody.h"

#include <Meshes.h>

#include <Eigen/Geometry>

#include <cmath>
#include <numbers>

namespace palpate::benchmark {
namespace {

using Eigen::Vector3d;
using Points = std::vector<Vector3d>;

constexpr auto kRows = [] {
  using enum SpatialQuery;
  using enum Place;
  constexpr std::array<std::size_t, 3> kMany{4000, 4000, 4000}, kFar{4000, 2000, 1000},
      kLists{2000, 2000, 2000}, kShapes{500, 200, 40};
  return std::array{
      SpatialRow{"closest near", Closest, Near, kMany, {0.5, 0.8, 1.5}, {0.61, 1.06, 1.9}},
      SpatialRow{"closest 10 %", Closest, Tenth, kFar, {0.8, 2.1, 8}, {0.99, 2.8, 10.8}},
      SpatialRow{"closest anywhere", Closest, Anywhere, kFar, {1.7, 4.5, 14}, {2.2, 5.8, 18}},
      SpatialRow{
          "signed distance near", SignedDistance, Near, kMany, {0.6, 1.0, 1.8}, {0.73, 1.6, 2.6}},
      SpatialRow{
          "closest near, batch", Closest, Near, kMany, {0.5, 0.8, 1.5}, {0.61, 1.06, 1.9}, true},
      SpatialRow{"signed distance near, batch",
                 SignedDistance,
                 Near,
                 kMany,
                 {0.6, 1.0, 1.8},
                 {0.73, 1.6, 2.6},
                 true},
      SpatialRow{
          "first hits, batch", FirstHit, Rays, kMany, {0.22, 0.40, 0.75}, {0.20, 0.31, 0.56}, true},
      SpatialRow{"first hit, raster", FirstHit, Raster, kMany, {}, {}},
      SpatialRow{"first hits, raster, batch", FirstHit, Raster, kMany, {}, {}, true},
      SpatialRow{"all hits, raster, batch", AllHits, Raster, kMany, {}, {}, true},
      SpatialRow{"first hit, fan", FirstHit, Fan, kMany, {}, {}},
      SpatialRow{"first hits, fan, batch", FirstHit, Fan, kMany, {}, {}, true},
      SpatialRow{"all hits, fan, batch", AllHits, Fan, kMany, {}, {}, true},
      SpatialRow{"contains", Contains, InBox, kMany, {0.22, 0.33, 0.6}, {0.25, 0.38, 0.67}},
      SpatialRow{"first hit", FirstHit, Rays, kMany, {0.22, 0.40, 0.75}, {0.20, 0.31, 0.56}},
      SpatialRow{"8 nearest", EightNearest, Near, kLists, {1.5, 2.2, 3.3}, {2.1, 3.0, 4.3}},
      SpatialRow{"ball", Ball, Surface, kLists, {1.9, 2.7, 4.3}, {2.5, 3.5, 5.6}},
      SpatialRow{"capsule", Capsule, Surface, kShapes, {4, 30, 220}, {22, 181, 1358}},
      SpatialRow{"oriented box", Box, Surface, kShapes, {5, 45, 400}, {20, 213, 1922}}};
}();
constexpr auto kPointRows = [] {
  using enum SpatialQuery;
  using enum Place;
  constexpr std::array<std::size_t, 3> kMany{4000, 4000, 4000}, kFar{4000, 2000, 1000};
  return std::array{SpatialRow{"closest near", Closest, Near, kMany, {}, {}},
                    SpatialRow{"closest anywhere", Closest, Anywhere, kFar, {}, {}},
                    SpatialRow{"8 nearest", EightNearest, Near, kMany, {}, {}},
                    SpatialRow{"ball", Ball, Surface, kMany, {}, {}}};
}();

Eigen::AlignedBox3d boxOf(const Points& positions) {
  Eigen::AlignedBox3d box;
  for (const Vector3d& p : positions) box.extend(p);
  return box;
}

Vector3d direction(testing::Random& random) {
  for (;;) {
    const Vector3d d = testing::randomPoint(random, -1, 1);
    if (d.squaredNorm() > 0.01 && d.squaredNorm() < 1) return d.normalized();
  }
}

}  // namespace

std::span<const SpatialRow> SpatialBody::rows() const {
  return isPointSet ? std::span<const SpatialRow>(kPointRows) : kRows;
}

SpatialBody makeBody(std::size_t size, bool isPointSet) {
  constexpr const char* kSizes[] = {"10K", "100K", "1M"};
  constexpr int kFrequencies[] = {22, 71, 224}, kPointFrequencies[] = {32, 100, 316};
  const scenes::SceneMesh sphere =
      scenes::sphere(isPointSet ? kPointFrequencies[size] : kFrequencies[size]);
  SpatialBody body{kSizes[size] + std::string(isPointSet ? " points" : " triangles"),
                   size,
                   isPointSet,
                   sphere.triangles,
                   {},
                   0,
                   scenes::meanEdge({sphere}),
                   {}};
  if (isPointSet) {
    body.triangles.clear();
    for (std::uint32_t i = 0; i < sphere.positions.size(); ++i) body.triangles.push_back({i, i, i});
  }
  for (std::size_t frame = 0; frame < kFrames; ++frame) {
    Points positions = sphere.positions;
    for (Vector3d& p : positions)
      p *= 1 + 0.1 * std::sin(9 * p[0] + 0.1 * static_cast<double>(frame)) *
                   std::cos(11 * p[1] + 5 * p[2]);
    body.frames.push_back(std::move(positions));
  }
  body.diagonal = boxOf(body.frames[0]).diagonal().norm();
  body.sizes = {2 * body.edge, 0.01 * body.diagonal, 0.2 * body.diagonal,
                body.diagonal * Vector3d(0.08, 0.03, 0.02)};
  return body;
}

std::vector<SpatialCase> makeCases(const SpatialBody& body, const Points& positions, Place place,
                                   std::size_t count, testing::Random& random) {
  const Eigen::AlignedBox3d box = boxOf(positions);
  const auto inBox = [&](double scale) -> Vector3d {
    return box.center() +
           testing::randomPoint(random, -scale / 2, scale / 2).cwiseProduct(box.sizes());
  };
  std::vector<SpatialCase> cases(count);
  // Images are square, and centred on the body.
  const auto side = static_cast<std::size_t>(std::sqrt(static_cast<double>(count)));
  for (SpatialCase& c : cases) {
    const auto number = static_cast<std::size_t>(&c - cases.data());
    const double x = static_cast<double>(number % side) - 0.5 * static_cast<double>(side),
                 y = static_cast<double>(number / side) - 0.5 * static_cast<double>(side);
    const auto& [i, j, k] = body.triangles[random() % body.triangles.size()];
    const Vector3d weights = testing::randomPoint(random, 0, 1);
    const Vector3d surface =
        (weights[0] * positions[i] + weights[1] * positions[j] + weights[2] * positions[k]) /
        weights.sum();
    const auto offSurface = [&](double distance) -> Vector3d {
      return surface +
             testing::uniform(random, -distance, distance) * (surface - box.center()).normalized();
    };
    switch (place) {
      case Place::Near:
        c.point = offSurface(body.edge);
        break;
      case Place::Tenth:
        c.point = offSurface(0.1 * body.diagonal);
        break;
      case Place::Anywhere:
        c.point = inBox(2);
        break;
      case Place::InBox:
        c.point = inBox(1);
        break;
      case Place::Rays:
        c.point = inBox(2);
        c.direction = (inBox(1) - c.point).normalized();
        break;
      case Place::Raster:
        c.point = box.center() + body.diagonal * Vector3d(0.3, 0.2, -1.5);
        c.direction =
            (box.center() + body.diagonal / 512 * Vector3d(x, y, 0) - c.point).normalized();
        break;
      case Place::Fan: {
        const double angle = x / 256 * std::numbers::pi / 3;
        c.point = box.center() + body.diagonal * Vector3d(0, y / 512, -0.6);
        c.direction = Vector3d(std::sin(angle), 0.1, std::cos(angle)).normalized();
        break;
      }
      case Place::Surface:
        c.point = surface;
        c.rotation =
            Eigen::Quaterniond::FromTwoVectors(Vector3d::UnitX(), direction(random)).matrix();
        c.rotation *= Eigen::AngleAxisd(testing::uniform(random, 0, 6), Vector3d::UnitX()).matrix();
        break;
    }
  }
  return cases;
}

}  // namespace palpate::benchmark
