#pragma once

// Scenes of some hundred steps, with Palpate or with iMSTK's own classes, and what judges them
// without Palpate: exact crossings and distances of the stored positions in long double, by brute
// force.
#include "Scenes.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

namespace trials {

using Real = long double;
using Vector = Eigen::Matrix<Real, 3, 1>;

inline Real volume(const Vector& a, const Vector& b, const Vector& c, const Vector& d) {
  return (b - a).cross(c - a).dot(d - a);
}
inline Real distance(const Vector& p, const Vector& a, const Vector& b) {
  const Vector along = b - a;
  const Real t = std::clamp(along.dot(p - a) / along.squaredNorm(), Real(0), Real(1));
  return (p - a - t * along).norm();
}
inline Real distance(const Vector& p, const std::array<Vector, 3>& t) {
  Real least =
      std::min({distance(p, t[0], t[1]), distance(p, t[1], t[2]), distance(p, t[2], t[0])});
  const Vector n = (t[1] - t[0]).cross(t[2] - t[0]);
  bool isAbove = true;
  for (int i = 0; i < 3; ++i) isAbove &= n.dot((t[(i + 1) % 3] - t[i]).cross(p - t[i])) >= 0;
  return isAbove ? std::min(least, std::abs(n.dot(p - t[0])) / n.norm()) : least;
}
inline Real distance(const Vector& p0, const Vector& p1, const Vector& q0, const Vector& q1) {
  Real least = std::min(
      {distance(p0, q0, q1), distance(p1, q0, q1), distance(q0, p0, p1), distance(q1, p0, p1)});
  const Vector u = p1 - p0, v = q1 - q0, w = p0 - q0;
  const Real uu = u.dot(u), uv = u.dot(v), vv = v.dot(v), det = uu * vv - uv * uv;
  if (det <= 0) return least;
  const Real s = (uv * v.dot(w) - vv * u.dot(w)) / det, t = (uu * v.dot(w) - uv * u.dot(w)) / det;
  if (s < 0 || s > 1 || t < 0 || t > 1) return least;
  return std::min(least, (w + s * u - t * v).norm());
}
/// Whether a segment meets a triangle, touching included.
inline bool crosses(const Vector& p, const Vector& q, const std::array<Vector, 3>& t) {
  const Real below = volume(t[0], t[1], t[2], p), above = volume(t[0], t[1], t[2], q);
  if ((below > 0 && above > 0) || (below < 0 && above < 0)) return false;
  const Real noise = 1e-17L * (t[1] - t[0]).norm() * (t[2] - t[0]).norm() *
                     std::max((p - t[0]).norm(), (q - t[0]).norm());
  if (std::abs(below - above) > noise)
    return distance(p + below / (below - above) * (q - p), t) < 1e-15L;
  Real least = std::min(distance(p, t), distance(q, t));  // in its plane
  for (int i = 0; i < 3; ++i) least = std::min(least, distance(p, q, t[i], t[(i + 1) % 3]));
  return least < 1e-15L;
}
/// Of a segment from a triangle; 0 if it meets it.
inline Real distance(const Vector& p, const Vector& q, const std::array<Vector, 3>& t) {
  if (crosses(p, q, t)) return 0;
  Real least = std::min(distance(p, t), distance(q, t));
  for (int i = 0; i < 3; ++i) least = std::min(least, distance(p, q, t[i], t[(i + 1) % 3]));
  return least;
}

/// The triangles and edges of a mesh at the stored positions.
struct Placed {
  std::vector<Vector> positions;
  std::vector<std::array<int, 3>> triangles;
  std::vector<std::array<int, 2>> edges;

  explicit Placed(imstk::PointSet& mesh) {
    for (const Vec3d& p : positionsIn(mesh)) positions.push_back(p.cast<Real>());
    std::set<std::array<int, 2>> found;
    if (auto* surface = dynamic_cast<imstk::SurfaceMesh*>(&mesh)) {
      for (const Eigen::Vector3i& cell : valuesOf(surface->getCells())) {
        triangles.push_back({cell[0], cell[1], cell[2]});
        for (int i = 0; i < 3; ++i)
          found.insert(
              {std::min(cell[i], cell[(i + 1) % 3]), std::max(cell[i], cell[(i + 1) % 3])});
      }
    } else if (auto* line = dynamic_cast<imstk::LineMesh*>(&mesh)) {
      for (const Eigen::Vector2i& cell : valuesOf(line->getCells()))
        found.insert({cell[0], cell[1]});
    }
    edges.assign(found.begin(), found.end());
  }
  std::array<Vector, 3> at(const std::array<int, 3>& t) const {
    return {positions[t[0]], positions[t[1]], positions[t[2]]};
  }
};

/// How many edges of `a` meet triangles of `b`. Those with a common vertex of one mesh do not
/// count.
inline std::size_t crossings(const Placed& a, const Placed& b, bool isItself) {
  struct Entry {
    Real low;
    std::array<int, 3> corners;
    Vector least, most;
  };
  std::vector<Entry> entries;
  Real width = 0;
  for (const auto& t : b.triangles) {
    const auto p = b.at(t);
    const Vector least = p[0].cwiseMin(p[1]).cwiseMin(p[2]),
                 most = p[0].cwiseMax(p[1]).cwiseMax(p[2]);
    entries.push_back({least.x(), t, least, most});
    width = std::max(width, most.x() - least.x());
  }
  std::sort(entries.begin(), entries.end(),
            [](const Entry& x, const Entry& y) { return x.low < y.low; });
  std::size_t count = 0;
  for (const auto& edge : a.edges) {
    const Vector &p = a.positions[edge[0]], &q = a.positions[edge[1]];
    const Vector least = p.cwiseMin(q), most = p.cwiseMax(q);
    auto entry = std::lower_bound(entries.begin(), entries.end(), least.x() - width,
                                  [](const Entry& e, Real x) { return e.low < x; });
    for (; entry != entries.end() && entry->low <= most.x(); ++entry) {
      if ((entry->least.array() > most.array()).any() ||
          (entry->most.array() < least.array()).any())
        continue;
      const auto& t = entry->corners;
      if (isItself && (std::find(t.begin(), t.end(), edge[0]) != t.end() ||
                       std::find(t.begin(), t.end(), edge[1]) != t.end()))
        continue;
      count += crosses(p, q, b.at(t));
    }
  }
  return count;
}

/// The least distance of a mesh from an axis of a capsule, less the radius. A sphere has two equal
/// ends.
inline Real gapOf(const Placed& mesh, const Vector& p, const Vector& q, Real radius) {
  Real least = 1e30L;
  for (const auto& t : mesh.triangles)
    least = std::min(least, p == q ? distance(p, mesh.at(t)) : distance(p, q, mesh.at(t)));
  for (const auto& e : mesh.edges)
    least = std::min(least, p == q ? distance(p, mesh.positions[e[0]], mesh.positions[e[1]])
                                   : distance(p, q, mesh.positions[e[0]], mesh.positions[e[1]]));
  return least - radius;
}

/// A scene, how it moves, and its judge.
struct Trial {
  bool isPalpate;
  TestScene test;
  int steps = 300;
  std::function<void(int)> move = [](int) {};
  /// How many pairs of features meet or overlap now.
  std::function<std::size_t()> judge;
  int judgedEvery = 1;
  std::vector<std::shared_ptr<imstk::PbdObject>> moving;  ///< come to rest
  std::function<double()> force = nullptr;                ///< on a tool
  std::shared_ptr<imstk::PbdObject> tool;                 ///< that feels it

  explicit Trial(bool palpate) : isPalpate(palpate) {
    test.config().m_gravity = {0, -9.81, 0};
    test.config().m_linearDampingCoeff = test.config().m_angularDampingCoeff = 0.02;
  }

  void collide(const std::shared_ptr<imstk::PbdObject>& a,
               const std::shared_ptr<imstk::CollidingObject>& b, double friction,
               const std::string& own, const palpate::PalpateSettings& settings = {}) {
    const auto interaction = isPalpate ? test.palpateScene.makeCollision(a, b, settings)
                                       : std::make_shared<imstk::PbdObjectCollision>(a, b, own);
    interaction->setFriction(friction);
    if (!isPalpate) interaction->setDeformableStiffnessA(0.9);
    test.scene->addInteraction(interaction);
  }
  std::shared_ptr<imstk::PbdObject> cloth(const std::shared_ptr<imstk::SurfaceMesh>& mesh,
                                          double mass, double stiffness = 1000) {
    const auto object = test.deformable("cloth", mesh);
    object->getPbdBody()->uniformMassValue = mass;
    const int handle = object->getPbdBody()->bodyHandle;
    test.config().enableConstraint(imstk::PbdModelConfig::ConstraintGenType::Distance, stiffness,
                                   handle);
    moving.push_back(object);
    return object;
  }
  double fastest() const {
    double speed = 0;
    for (const auto& object : moving)
      for (const Vec3d& v : valuesOf(object->getPbdBody()->velocities))
        speed = std::max(speed, v.norm());
    return speed;
  }
};

inline Placed placed(const std::shared_ptr<imstk::PbdObject>& object) {
  object->updateGeometries();
  return Placed(dynamic_cast<imstk::PointSet&>(*object->getCollidingGeometry()));
}

// ---- The scenes.

/// kind 0: free, 1: pinned at one side, 2: pushed up by the capsule.
inline std::unique_ptr<Trial> clothOnCapsule(bool palpate, int kind) {
  auto trial = std::make_unique<Trial>(palpate);
  const auto mesh = sheet({0, 0.7, 0}, 14);
  const auto cloth = trial->cloth(mesh, 0.01);
  if (kind == 1)
    for (int i = 0; i < mesh->getNumVertices(); ++i)
      if (mesh->getVertexPosition(i).x() == -1) cloth->getPbdBody()->fixedNodeIds.push_back(i);
  const Vec3d centre(0.02, 0, 0.03);
  const auto capsule = std::make_shared<imstk::Capsule>(
      centre, 0.3, 1.0, imstk::Quatd::FromTwoVectors(Vec3d(0, 1, 0), Vec3d(1, 0, 0)));
  trial->collide(cloth, trial->test.tool(capsule), 0.6, "SurfaceMeshToCapsuleCD");
  trial->steps = kind == 1 ? 1000 : 500;
  if (kind == 2)
    trial->move = [=](int step) {
      capsule->setPosition(centre +
                           Vec3d(0, 0.6 * std::min(1.0, std::max(0, step - 50) / 100.0), 0));
    };
  trial->judge = [=] {
    const Vector c = capsule->getPosition().cast<Real>(), half(0.5L, 0, 0);
    return std::size_t(gapOf(placed(cloth), c - half, c + half, 0.3L) > 0 ? 0 : 1);
  };
  return trial;
}

inline std::unique_ptr<Trial> threadOnOrgan(bool palpate) {
  auto trial = std::make_unique<Trial>(palpate);
  const auto organ = trial->test.tissue(block(6, 3, 6, {-1, -1, -1}, {2, 1, 2}), 5000, 0.02);
  std::vector<Vec3d> nodes;
  std::vector<Eigen::Vector2i> segments;
  for (int i = 0; i <= 60; ++i) nodes.push_back({-0.9 + 0.03 * i, 0.15, 0.3 * std::sin(0.2 * i)});
  for (int i = 0; i < 60; ++i) segments.emplace_back(i, i + 1);
  const auto line = std::make_shared<imstk::LineMesh>();
  line->initialize(positionArray(nodes), cellArray<2>(segments));
  const auto thread = trial->test.deformable("thread", line);
  thread->getPbdBody()->uniformMassValue = 0.002;
  trial->test.config().enableConstraint(imstk::PbdModelConfig::ConstraintGenType::Distance, 1e4,
                                        thread->getPbdBody()->bodyHandle);
  trial->moving.push_back(thread);
  trial->test.palpateScene.setRadius(line, 0.01);
  trial->collide(organ, thread, 0.3, "ClosedSurfaceMeshToMeshCD");
  trial->steps = 500;
  trial->judge = [=] {  // the axis of the thread, with its radius
    const Placed a = placed(thread), b = placed(organ);
    std::size_t count = 0;
    for (const auto& edge : a.edges)
      for (const auto& t : b.triangles)
        count +=
            distance(a.positions[edge[0]], a.positions[edge[1]], b.at(t)) < 0.01L * (1 - 1e-6L);
    return count;
  };
  return trial;
}

/// A rigid needle that a program leads to and fro over tissue, and into it.
inline std::unique_ptr<Trial> needleAtTissue(bool palpate) {
  auto trial = std::make_unique<Trial>(palpate);
  const auto organ = trial->test.tissue(block(6, 3, 6, {-1, -1, -1}, {2, 1, 2}), 5000, 0.02);
  const auto line = std::make_shared<imstk::LineMesh>();
  line->initialize(positionArray({{0, 0.6, 0}, {0, 0.3, 0}, {0, 0, 0}}),
                   cellArray<2>({{0, 1}, {1, 2}}));
  const auto needle = trial->test.rigid("needle", line, {0.07, 0.1, 0.03});
  needle->getPbdBody()->bodyGravity = false;
  trial->collide(needle, organ, 0.0, "ClosedSurfaceMeshToMeshCD");
  trial->test.config().m_gravity = Vec3d::Zero();
  trial->steps = 600;
  trial->move = [=](int step) {  // a spring of 200 to a point 0.15 deep that moves in a circle
    const double angle = 0.02 * step;
    const Vec3d goal(0.07 + 0.3 * std::sin(angle), 0.1 - 0.25 * std::min(1.0, step / 100.0),
                     0.03 + 0.3 * (1 - std::cos(angle)));
    needle->getPbdBody()->externalForce = 200 * (goal - particle(*needle)) - 28 * velocity(*needle);
    const imstk::Quatd q = (*needle->getPbdBody()->orientations)[0];
    needle->getPbdBody()->externalTorque =
        -400 * 2 * Vec3d(q.x(), q.y(), q.z()) * (q.w() < 0 ? -1 : 1) -
        40 * (*needle->getPbdBody()->angularVelocities)[0];
  };
  trial->judge = [=] { return crossings(placed(needle), placed(organ), false); };
  return trial;
}

/// Whether two cubes of the half edge `half` overlap: by the fifteen axes that separate boxes.
inline bool overlap(imstk::PbdObject& a, imstk::PbdObject& b, Real half) {
  const auto axesOf = [](imstk::PbdObject& cube) -> Eigen::Matrix<Real, 3, 3> {
    return (*cube.getPbdBody()->orientations)[0].normalized().toRotationMatrix().cast<Real>();
  };
  const Eigen::Matrix<Real, 3, 3> axesOfA = axesOf(a), axesOfB = axesOf(b);
  const Vector way = (particle(b) - particle(a)).cast<Real>();
  std::vector<Vector> axes;
  for (int i = 0; i < 3; ++i) {
    axes.push_back(axesOfA.col(i));
    axes.push_back(axesOfB.col(i));
    for (int k = 0; k < 3; ++k) axes.push_back(axesOfA.col(i).cross(axesOfB.col(k)));
  }
  return std::none_of(axes.begin(), axes.end(), [&](const Vector& axis) {
    const Real reach = half * ((axesOfA.transpose() * axis).cwiseAbs().sum() +
                               (axesOfB.transpose() * axis).cwiseAbs().sum());
    return std::abs(axis.dot(way)) > reach;
  });
}

/// Cubes of triangles, side by side or on a heap.
inline std::unique_ptr<Trial> cubes(bool palpate, bool isHeap) {
  auto trial = std::make_unique<Trial>(palpate);
  const auto floor = trial->test.floor(sheet({0, 0, 0}, 4, 8));
  auto& all = trial->moving;
  for (int i = 0; i < 6; ++i) {
    const Vec3d at = isHeap ? Vec3d(0.06 * (i % 3), 0.5 + 0.9 * i, 0.05 * (i % 2))
                            : Vec3d(0.9 * (i % 3) - 0.9, 0.4 + 0.1 * i, 0.9 * (i / 3) - 0.4);
    all.push_back(trial->test.rigid("cube", cube({0, 0, 0}, 0.25), at));
    (*all.back()->getPbdBody()->inertias)[0] = imstk::Mat3d::Identity() * 0.25 / 6;
    (*all.back()->getPbdBody()->orientations)[0] =
        imstk::Quatd(Eigen::AngleAxisd(0.3 * i, Vec3d(1, 2, 0.5 * i).normalized()));
    trial->collide(all.back(), floor, 0.5, "SurfaceMeshToSurfaceMeshCD");
    for (int k = 0; k < i; ++k)
      trial->collide(all[static_cast<std::size_t>(i)], all[static_cast<std::size_t>(k)], 0.5,
                     "SurfaceMeshToSurfaceMeshCD");
  }
  trial->steps = 600;
  trial->judge = [floor, bodies = all] {
    std::size_t count = 0;
    for (std::size_t i = 0; i < bodies.size(); ++i) {
      const imstk::Quatd q = (*bodies[i]->getPbdBody()->orientations)[0];
      const Real low =
          static_cast<Real>(particle(*bodies[i]).y()) -
          0.25L * q.normalized().toRotationMatrix().cast<Real>().row(1).cwiseAbs().sum();
      count += low <= 0;
      for (std::size_t k = 0; k < i; ++k) count += overlap(*bodies[i], *bodies[k], 0.25L);
    }
    return count;
  };
  return trial;
}

/// A narrow cloth that falls on its end and folds, on a floor.
inline std::unique_ptr<Trial> clothWithItself(bool palpate) {
  auto trial = std::make_unique<Trial>(palpate);
  const auto mesh = sheet({0, 0, 0}, 14, 1.4);
  for (Vec3d& p : positionsIn(*mesh)) {  // a wave that stands on its edge
    const double along = p.x() + 0.7;
    p = {0.08 * std::sin(6 * along), 0.1 + along, 0.5 * p.z()};
  }
  mesh->setInitialVertexPositions(
      std::make_shared<imstk::VecDataArray<double, 3>>(*mesh->getVertexPositions()));
  const auto cloth = trial->cloth(mesh, 0.01);
  const auto floor = trial->test.floor(sheet({0, 0, 0}, 2, 6));
  trial->collide(cloth, floor, 0.5, "SurfaceMeshToSurfaceMeshCD");
  palpate::PalpateSettings self;
  self.thickness = 0.02;
  self.restDistance = 0.06;
  trial->collide(cloth, cloth, 0.3, "SurfaceMeshToSurfaceMeshCD", self);
  trial->steps = 600;
  trial->judge = [=] {
    const Placed a = placed(cloth), b = placed(floor);
    return crossings(a, a, true) + crossings(a, b, false) + crossings(b, a, false);
  };
  return trial;
}

struct Press {
  const char* tool = "capsule";  ///< or sphere, box, mesh
  bool bySpring = true;          ///< else a force alone
  unsigned iterations = 10;
  double thickness = 0.01;
};
constexpr double kPressPerStep = 0.45 / 120;

/// A tool is pressed into tissue, held and drawn back.
inline std::unique_ptr<Trial> toolAndTissue(bool palpate, const Press& press = {}) {
  auto trial = std::make_unique<Trial>(palpate);
  trial->test.config().m_iterations = press.iterations;
  trial->test.config().m_gravity = Vec3d::Zero();
  trial->test.config().m_linearDampingCoeff = 0.03;
  const auto organ = trial->test.tissue(block(6, 4, 6, {-1, -1, -1}, {2, 1, 2}), 5000, 0.02);
  const std::string kind = press.tool;
  std::shared_ptr<imstk::Geometry> geometry = std::make_shared<imstk::Capsule>(
      Vec3d(0, 0, 0), 0.2, 0.6, imstk::Quatd::FromTwoVectors(Vec3d(0, 1, 0), Vec3d(1, 0, 0)));
  std::string own = "SurfaceMeshToCapsuleCD";
  if (kind == "sphere") {
    geometry = std::make_shared<imstk::Sphere>(Vec3d(0, 0, 0), 0.2);
    own = "SurfaceMeshToSphereCD";
  } else if (kind == "box") {
    geometry = std::make_shared<imstk::OrientedBox>(Vec3d(0, 0, 0), Vec3d(0.2, 0.2, 0.2));
    own = "PointSetToOrientedBoxCD";
  } else if (kind == "mesh") {
    geometry = cube({0, 0, 0}, 0.2);
    own = "SurfaceMeshToSurfaceMeshCD";
  }
  const auto tool = trial->test.rigid("tool", geometry, {0.03, 0.25, 0.02});
  palpate::PalpateSettings settings;
  settings.thickness = press.thickness;
  trial->collide(organ, tool, 0.0, own, settings);
  trial->tool = tool;
  trial->steps = 400;
  const auto device = std::make_shared<Vec3d>(0, 0, 0);
  trial->move = [=, bySpring = press.bySpring](int step) {
    imstk::PbdBody& body = *tool->getPbdBody();
    (*body.invInertias)[0].setZero();  // it does not turn
    const double share = std::min(1.0, std::min(step, 400 - step) / 120.0);
    *device = Vec3d(0.03, 0.25 - 0.45 * share, 0.02);
    const Vec3d damping = -2 * std::sqrt(500.0) * velocity(*tool);  // critical, of mass 1
    body.externalForce = bySpring ? Vec3d(500 * (*device - particle(*tool)) + damping)
                                  : Vec3d(Vec3d(0, -80 * share + 5 * (1 - share), 0) + damping);
  };
  if (kind == "capsule")
    trial->judge = [=] {
      const Vector c = particle(*tool).cast<Real>(), half(0.3L, 0, 0);
      return std::size_t(gapOf(placed(organ), c - half, c + half, 0.2L) > -1e-9L ? 0 : 1);
    };
  trial->force = [=] { return 500 * (particle(*tool) - *device).y(); };
  return trial;
}

/// A drop of 10,728 triangles: a ribbon of 36 x 149 squares over a capsule, with itself and a
/// floor.
inline std::unique_ptr<Trial> drop(bool palpate) {
  auto trial = std::make_unique<Trial>(palpate);
  std::vector<Vec3d> positions;
  std::vector<Eigen::Vector3i> cells;
  for (int i = 0; i <= 149; ++i)
    for (int k = 0; k <= 36; ++k)
      positions.push_back({0.02 * i - 1.49, 0.75 + 0.05 * std::sin(0.1 * i), 0.02 * k - 0.36});
  for (int i = 0; i < 149; ++i)
    for (int k = 0; k < 36; ++k) {
      const int a = i * 37 + k, b = a + 37;
      cells.emplace_back(a, a + 1, b);
      cells.emplace_back(a + 1, b + 1, b);
    }
  const auto mesh = std::make_shared<imstk::SurfaceMesh>();
  mesh->initialize(positionArray(positions), cellArray<3>(cells));
  const auto cloth = trial->cloth(mesh, 0.001);
  trial->test.config().m_linearDampingCoeff = 0.05;
  const Vec3d centre(0.1, 0.4, 0.02);
  const auto capsule = std::make_shared<imstk::Capsule>(
      centre, 0.15, 1.0, imstk::Quatd::FromTwoVectors(Vec3d(0, 1, 0), Vec3d(0, 0, 1)));
  const auto floor = trial->test.floor(sheet({0, 0, 0}, 2, 6));
  trial->collide(cloth, trial->test.tool(capsule), 0.6, "SurfaceMeshToCapsuleCD");
  trial->collide(cloth, floor, 0.5, "SurfaceMeshToSurfaceMeshCD");
  palpate::PalpateSettings self;
  self.thickness = 0.008;
  self.restDistance = 0.025;
  trial->collide(cloth, cloth, 0.3, "SurfaceMeshToSurfaceMeshCD", self);
  trial->steps = palpate ? 300 : 2;  // iMSTK compares all triangles with all
  trial->judgedEvery = 10;
  trial->judge = [=] {
    const Placed a = placed(cloth), b = placed(floor);
    const Vector c = centre.cast<Real>(), half(0, 0, 0.5L);
    return crossings(a, a, true) + crossings(a, b, false) + crossings(b, a, false) +
           std::size_t(gapOf(a, c - half, c + half, 0.15L) > 0 ? 0 : 1);
  };
  return trial;
}

struct Named {
  const char* name;
  const char* title;
  std::function<std::unique_ptr<Trial>(bool)> make;
};
inline std::vector<Named> all() {
  return {
      {"ClothFree", "cloth on a capsule, free", [](bool p) { return clothOnCapsule(p, 0); }},
      {"ClothPinned", "cloth on a capsule, pinned", [](bool p) { return clothOnCapsule(p, 1); }},
      {"ClothPushed", "cloth on a capsule, pushed", [](bool p) { return clothOnCapsule(p, 2); }},
      {"Thread", "thread on an organ", threadOnOrgan},
      {"Needle", "needle at tissue", needleAtTissue},
      {"CubesApart", "six rigid cubes, apart", [](bool p) { return cubes(p, false); }},
      {"CubesHeap", "six rigid cubes, a heap", [](bool p) { return cubes(p, true); }},
      {"ClothItself", "cloth with itself", clothWithItself},
      {"ToolSpring", "tool on a spring in tissue", [](bool p) { return toolAndTissue(p); }},
      {"ToolForce", "tool by a force in tissue",
       [](bool p) {
         return toolAndTissue(p, {"capsule", false});
       }},
      {"Drop", "drop of 10,728 triangles", drop}};
}

}  // namespace trials
