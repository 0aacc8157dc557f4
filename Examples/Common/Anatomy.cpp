#include "Anatomy.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>
#include <span>

namespace palpate::scenes {

using Eigen::AlignedBox3d, Eigen::Vector3d;

namespace {

const Vector3d kFundus(-27, -65, -50), kBody(-24, -55, -39), kNeck(-19, -42, -26);

constexpr double kRoom = 0.8;  // between organs

double bump(double x, double width) { return std::exp(-x * x / (2 * width * width)); }

/// The liver's lower surface: it rises to the left and to the back, and is hollow.
double visceralHeight(const Vector3d& p) {
  return 18 + 0.55 * p.x() + 0.82 * p.y() + 12 * bump(p.x() + 20, 35) * bump(p.y() + 5, 30);
}

double gallbladder(const Vector3d& p) {
  const double sac = smoothMin(toCone(p, kFundus, kBody, 9, 8), toCone(p, kBody, kNeck, 8, 3.5), 5);
  const double duct = std::min(toCone(p, kNeck, {-9, -24, -22}, 3, 2.4),
                               toCone(p, {-9, -24, -22}, {-2, -8, -18}, 2.4, 2.4));
  return smoothMin(sac, duct, 4);
}

double liver(const Vector3d& p) {
  const double right = toEllipsoid(p, {-46, 4, 2}, {66, 64, 80}),
               left = toEllipsoid(p, {44, -8, 28}, {72, 36, 38}),
               middle = toEllipsoid(p, {0, -2, 20}, {60, 50, 55});
  double body = smoothMin(smoothMin(right, middle, 30), left, 25);
  // The lower surface meets the front in an edge.
  body = smoothMax(body, 0.72 * (visceralHeight(p) - p.z()), 18);
  // The notch between the lobes.
  body = smoothMax(body, -toEllipsoid(p, {17, -40, -8}, {5, 25, 14}), 8);
  return smoothMax(body, kRoom - gallbladder(p), 3);  // the gallbladder's fossa
}

double stomach(const Vector3d& p) {
  // From the fundus under the diaphragm along the greater curvature to the pylorus.
  static const std::vector<Vector3d> kAxis = curve(
      {{66, 20, 42}, {60, 14, 16}, {56, 0, -14}, {45, -14, -42}, {24, -20, -56}, {3, -14, -56}});
  const auto radius = [](std::size_t i) {  // widest in its body
    const double along = static_cast<double>(i) / static_cast<double>(kAxis.size() - 1);
    return 28 - 20 * along * along;
  };
  double body = 1e9;
  for (std::size_t i = 0; i + 1 < kAxis.size(); ++i)
    body = std::min(body, toCone(p, kAxis[i], kAxis[i + 1], radius(i), radius(i + 1)));
  return smoothMax(body, kRoom - liver(p), 4);
}

double kidney(const Vector3d& p) {
  const Vector3d q = Eigen::AngleAxisd(0.25, Vector3d::UnitY()) * (p - Vector3d(-58, 36, -34));
  const double bean =
      toEllipsoid(q + Vector3d(0.003 * q.z() * q.z(), 0, 0), {3, 0, 0}, {27, 21, 54});
  const double hilum = toEllipsoid(q, {31, 0, 2}, {11, 9, 15});
  return smoothMax(smoothMax(bean, -hilum, 9), kRoom - liver(p), 4);
}

double spleen(const Vector3d& p) {
  const Vector3d q = Eigen::AngleAxisd(-0.5, Vector3d::UnitY()) * (p - Vector3d(101, 30, 16));
  const double lens = toEllipsoid(q, {0, 0, 0}, {22, 36, 55});
  return smoothMax(smoothMax(lens, kRoom - stomach(p), 5), kRoom - liver(p), 4);
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
  return meshOf(gallbladder, AlignedBox3d(Vector3d(-50, -85, -75), Vector3d(10, 5, -5)), edge);
}

SceneMesh anatomicalStomach(double edge) {
  return meshOf(stomach, AlignedBox3d(Vector3d(-15, -50, -85), Vector3d(105, 60, 85)), edge);
}

SceneMesh anatomicalKidney(double edge) {
  return meshOf(kidney, AlignedBox3d(Vector3d(-110, 0, -100), Vector3d(-10, 70, 35)), edge);
}

SceneMesh anatomicalSpleen(double edge) {
  return meshOf(spleen, AlignedBox3d(Vector3d(45, -15, -60), Vector3d(155, 80, 90)), edge);
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
