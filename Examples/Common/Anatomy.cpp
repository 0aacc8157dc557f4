#include "Anatomy.h"

#include <algorithm>
#include <cmath>
#include <span>

namespace palpate::scenes {

using Eigen::AlignedBox3d, Eigen::Vector3d;

namespace {

const Vector3d kFundus(-27, -64, -52), kBody(-21, -44, -33), kNeck(-9, -14, -8);

double bump(double x, double width) { return std::exp(-x * x / (2 * width * width)); }

/// The liver's lower surface: it rises to the left and to the back, and is hollow.
double visceralHeight(const Vector3d& p) {
  return 18 + 0.55 * p.x() + 0.82 * p.y() + 12 * bump(p.x() + 20, 35) * bump(p.y() + 5, 30);
}

double gallbladder(const Vector3d& p) {
  const double sac =
      smoothMin(toCone(p, kFundus, kBody, 13, 12.5), toCone(p, kBody, kNeck, 12.5, 5), 8);
  return smoothMin(sac, toCone(p, kNeck, {-2, -8, -18}, 4, 2.6), 5);
}

double liver(const Vector3d& p) {
  const double right = toEllipsoid(p, {-46, 4, 2}, {66, 64, 80}),
               left = toEllipsoid(p, {44, -8, 28}, {72, 36, 38}),
               middle = toEllipsoid(p, {0, -2, 20}, {60, 50, 55});
  double body = smoothMin(smoothMin(right, middle, 30), left, 25);
  // The lower surface meets the front in an edge.
  body = smoothMax(body, 0.72 * (visceralHeight(p) - p.z()), 7);
  // The notch between the lobes.
  body = smoothMax(body, -toEllipsoid(p, {17, -40, -8}, {5, 25, 14}), 8);
  return smoothMax(body, 0.8 - gallbladder(p), 3);  // the gallbladder's fossa
}

/// Points of a smooth curve through these.
std::vector<Vector3d> curve(const std::vector<Vector3d>& through) {
  constexpr int kSteps = 8;
  const auto at = [&](std::ptrdiff_t i) {
    return through[std::clamp<std::ptrdiff_t>(i, 0, std::ssize(through) - 1)];
  };
  std::vector<Vector3d> points;
  for (std::ptrdiff_t i = 0; i + 1 < std::ssize(through); ++i) {
    for (int step = 0; step < kSteps; ++step) {
      const double t = static_cast<double>(step) / kSteps, u = 1 - t;
      const Vector3d slope0 = (at(i + 1) - at(i - 1)) / 2, slope1 = (at(i + 2) - at(i)) / 2;
      points.push_back(u * u * (1 + 2 * t) * at(i) + t * t * (1 + 2 * u) * at(i + 1) +
                       t * u * (u * slope0 - t * slope1));
    }
  }
  points.push_back(through.back());
  return points;
}

/// Round branches that run into each other.
SceneMesh pipe(std::vector<std::vector<Vector3d>> branches, const std::vector<double>& radii,
               double edge) {
  AlignedBox3d box;
  for (std::vector<Vector3d>& branch : branches) {
    branch = curve(branch);
    for (const Vector3d& p : branch) box.extend(p);
  }
  const double margin = 2 * edge + *std::max_element(radii.begin(), radii.end());
  box.extend(Vector3d(box.min() - Vector3d::Constant(margin)));
  box.extend(Vector3d(box.max() + Vector3d::Constant(margin)));
  return meshOf(
      [&](const Vector3d& p) {
        double body = 1e9;
        for (std::size_t b = 0; b < branches.size(); ++b) {
          double branch = 1e9;
          for (std::size_t i = 0; i + 1 < branches[b].size(); ++i)
            branch =
                std::min(branch, toCone(p, branches[b][i], branches[b][i + 1], radii[b], radii[b]));
          body = b == 0 ? branch : smoothMin(body, branch, 0.8 * radii[b]);
        }
        return body;
      },
      box, edge);
}

}  // namespace

SceneMesh anatomicalLiver(double edge) {
  return meshOf(liver, AlignedBox3d(Vector3d(-125, -80, -100), Vector3d(125, 80, 95)), edge);
}

bool isInLiver(const Vector3d& p) { return liver(p) < 0; }

SceneMesh anatomicalGallbladder(double edge) {
  return meshOf(gallbladder, AlignedBox3d(Vector3d(-50, -85, -75), Vector3d(10, 5, 10)), edge);
}

SceneMesh portalVein(double edge) {
  return pipe({{{30, 12, -105}, {24, 8, -70}, {8, 4, -35}, {2, 2, -8}, {-16, 10, 8}, {-30, 16, 30}},
               {{4, 3, -20}, {8, 4, -2}, {24, 8, 18}, {32, 10, 36}}},
              {6.5, 5}, edge);
}

SceneMesh hepaticArtery(double edge) {
  return pipe({{{52, 6, -112},
                {44, -2, -80},
                {28, -10, -48},
                {15, -9, -25},
                {14, -7, -4},
                {24, 2, 14},
                {28, 6, 30}},
               {{16, -9, -28}, {8, -9, -12}, {-8, -2, 6}, {-18, 6, 26}}},
              {2.6, 2}, edge);
}

SceneMesh bileDuct(double edge) {
  return pipe(
      {{{16, -2, -105}, {6, -8, -70}, {-1, -10, -45}, {-2, -8, -18}, {0, -2, 4}, {2, 6, 26}}}, {3},
      edge);
}

}  // namespace palpate::scenes
