#include "Case.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace palpate::stability {

namespace {

using Eigen::Vector3d;
using testing::Random;
using testing::uniform;

/// L: for triangles of size 1.
constexpr double kThickness = 0.05;
constexpr int kSteps = 25;

std::vector<double> powers(double from, double to) {
  std::vector<double> values;
  for (int i = 0; i < kSteps; ++i)
    values.push_back(std::pow(10, from + (to - from) * i / (kSteps - 1)));
  return values;
}

/// Parameters of a case. Triangle b rests at the plane z = 0. Triangle a comes down along -z and
/// sideways.
struct Design {
  bool edges = false;    ///< edge on edge; otherwise a's corner on b's face
  double start = 0.025;  ///< L: height of a's nearest point over b at the start
  double end = -0.025;   ///< L: the same at the end
  double slant = 0.3;    ///< sideways motion / motion down
  double sliver = 1;     ///< b's height / its base
  double angle = 1;      ///< radians between the edges
  double sizeOfB = 1;
};

Vector3d inPlane(double angle) { return {std::cos(angle), std::sin(angle), 0}; }

Corners faceOf(const Design& design, Random& random) {
  // The origin is inside the face.
  const double u = uniform(random, 0.2, 0.4), v = uniform(random, 0.2, 0.4), size = design.sizeOfB;
  Corners b{Vector3d(0, 0, 0), Vector3d(size, 0, 0),
            Vector3d(uniform(random, 0.3, 0.7) * size, 0.9 * size * design.sliver, 0)};
  const Vector3d inside = (1 - u - v) * b[0] + u * b[1] + v * b[2];
  for (Vector3d& corner : b) corner -= inside;
  return b;
}

/// A triangle with one corner at the origin and two above.
Corners cornerDown(Random& random) {
  const double turn = uniform(random, 0, 2 * std::numbers::pi);
  const double first = uniform(random, 0.5, 0.8), second = uniform(random, 0.5, 0.8),
               angle = uniform(random, 1, 2);
  return {Vector3d::Zero(), inPlane(turn) * 0.6 + Vector3d(0, 0, first),
          inPlane(turn + angle) * 0.6 + Vector3d(0, 0, second)};
}

/// A triangle with an edge through the origin. The third corner is above (side 1) or below.
Corners edgeThrough(double along, double side, double size, Random& random) {
  const double share = uniform(random, 0.3, 0.7), height = side * uniform(random, 0.5, 0.8),
               shift = uniform(random, -0.3, 0.3);
  return {-share * size * inPlane(along), (1 - share) * size * inPlane(along),
          size * (shift * inPlane(along) + 0.4 * inPlane(along + std::numbers::pi / 2) +
                  Vector3d(0, 0, height))};
}

/// Orders the corners so that each normal points to the other triangle.
void windTowardsEachOther(Case::Frame& frame) {
  const auto turn = [](Corners& t, const Vector3d& towards) {
    if ((t[1] - t[0]).cross(t[2] - t[0]).dot(towards) < 0) std::swap(t[1], t[2]);
  };
  turn(frame.b, Vector3d::UnitZ());
  turn(frame.a, -Vector3d::UnitZ());
}

void transform(Case& made, const std::function<Vector3d(const Vector3d&)>& f) {
  for (Case::Frame& frame : made.frames)
    for (Corners* corners : {&frame.a, &frame.b})
      for (Vector3d& corner : *corners) corner = f(corner);
}

Case build(const Design& design, Random& random, int frames = 1) {
  Case made{.frames = {}, .thickness = kThickness};
  Case::Frame frame;
  if (design.edges) {
    const double along = uniform(random, 0, 2 * std::numbers::pi);
    frame.b = edgeThrough(along, -1, design.sizeOfB, random);
    for (Vector3d& corner : frame.b) corner.z() *= design.sliver;
    frame.a = edgeThrough(along + design.angle, 1, 1, random);
  } else {
    frame.b = faceOf(design, random);
    frame.a = cornerDown(random);
  }
  windTowardsEachOther(frame);
  const Vector3d direction = inPlane(uniform(random, 0, 2 * std::numbers::pi)),
                 sideways = design.slant * uniform(random, 0, 1) * direction;
  // The sideways part is zero where the path meets b's plane.
  const auto at = [&](double height) -> Vector3d {
    return Vector3d(0, 0, height) + height * sideways;
  };
  for (int i = 0; i <= frames; ++i) {
    const double t = static_cast<double>(i) / frames;
    made.frames.push_back(frame);
    for (Vector3d& corner : made.frames.back().a)
      corner += at((1 - t) * design.start + t * design.end);
  }
  const double z = uniform(random, 0.1, 1), y = uniform(random, -1, 1), x = uniform(random, -1, 1),
               w = uniform(random, -1, 1);
  const Eigen::Matrix3d turn = Eigen::Quaterniond(w, x, y, z).normalized().toRotationMatrix();
  transform(made, [&](const Vector3d& p) -> Vector3d { return turn * p; });
  return made;
}

/// A path of this length down. Three quarters of the paths cross the plane; a quarter ends before.
Design onAPath(double length, Random& random) {
  const double crossing =
      random() % 4 == 0 ? uniform(random, 1.05, 1.5) : uniform(random, 0.1, 0.9);
  return {.edges = random() % 2 == 0, .start = crossing * length, .end = (crossing - 1) * length};
}
Design easy(Random& random) { return onAPath(0.5 * kThickness, random); }

Case deep(double depth, Random& random) {
  Case made = build({.start = -depth + 0.1 * kThickness, .end = -depth}, random);
  made.startsInside = true;
  return made;
}

Case gapped(double gap, Random& random) {
  const bool beyond = gap < 0.5 * kThickness && random() % 2 == 0;
  const double end = beyond ? -gap : gap;
  return build({.edges = random() % 2 == 0, .start = gap + 0.3 * kThickness, .end = end}, random);
}

Case farAway(double offset, Random& random) {
  Case made = build(easy(random), random);
  const Vector3d by = offset * testing::randomPoint(random, 0.5, 1);
  transform(made, [&](const Vector3d& p) -> Vector3d { return p + by; });
  return made;
}

Case scaled(double scale, Random& random) {
  Case made = build(easy(random), random);
  transform(made, [&](const Vector3d& p) -> Vector3d { return scale * p; });
  made.thickness *= scale;
  return made;
}

}  // namespace

scenes::Scene sceneOf(const Case& made) {
  scenes::Scene scene;
  for (const Corners& corners : {made.frames.front().a, made.frames.front().b})
    scene.meshes.push_back({{corners.begin(), corners.end()}, {{0, 1, 2}}});
  scene.pairs = {{0, 1}};
  scene.thickness = made.thickness;
  return scene;
}

std::vector<std::vector<Vector3d>> positionsOf(const Case::Frame& frame) {
  return {{frame.a.begin(), frame.a.end()}, {frame.b.begin(), frame.b.end()}};
}

Case neighbourOf(const Case& made, double noise, Random& random) {
  Case other = made;
  for (Case::Frame& frame : other.frames)
    for (Corners* corners : {&frame.a, &frame.b}) {
      const double extent = std::max(((*corners)[1] - (*corners)[0]).cwiseAbs().maxCoeff(),
                                     ((*corners)[2] - (*corners)[0]).cwiseAbs().maxCoeff());
      for (Vector3d& corner : *corners)
        corner += noise * extent * testing::randomPoint(random, -1, 1);
    }
  return other;
}

std::vector<Sweep> sweeps() {
  std::vector<double> subdivisions;
  for (int frames = 64, i = 0; i < kSteps; ++i) {
    subdivisions.push_back(1.0 / frames);
    frames = i < 12 ? frames - 4 : frames - 1;  // 64, 60, ... 16, 15, ... 4
  }
  subdivisions.insert(subdivisions.end(), {1.0 / 3, 1.0 / 2, 1.0});
  std::vector<Sweep> all{
      {"speed", "motion in a step / thickness", powers(-1, 3),
       [](double x, Random& random) { return build(onAPath(x * kThickness, random), random); }},
      {"depth", "depth / thickness", powers(-1, 1.2),
       [](double x, Random& random) { return deep(x * kThickness, random); }, true},
      {"sliver", "height of a triangle / its base", powers(0, -16),
       [](double x, Random& random) {
         Design design = easy(random);
         design.sliver = x;
         return build(design, random);
       }},
      {"parallel edges", "angle between edges (radians)", powers(0, -16),
       [](double x, Random& random) {
         Design design = easy(random);
         design.edges = true;
         design.angle = x;
         return build(design, random);
       }},
      {"gap", "gap or depth at the end / size", powers(0, -16), gapped},
      {"offset", "distance from the origin / size", powers(0, 15), farAway},
      {"small scale", "size of the triangles (L)", powers(0, -150), scaled},
      {"large scale", "size of the triangles (L)", powers(0, 150), scaled},
      {"size ratio", "size of one / size of the other", powers(0, 12),
       [](double x, Random& random) {
         Design design = easy(random);
         design.sizeOfB = x;
         return build(design, random);
       }},
      {"time step", "motion in a step / whole motion of 30 thicknesses", subdivisions,
       [](double x, Random& random) {
         return build(onAPath(30 * kThickness, random), random,
                      static_cast<int>(std::lround(1 / x)));
       }}};
  return all;
}

}  // namespace palpate::stability
