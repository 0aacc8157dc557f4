#pragma once

#include "Common/RandomMeshes.h"

#include <string>
#include <vector>

namespace palpate::testing {

/// Two small meshes with a degenerate feature, and a step that brings them together.
struct DegenerateCase {
  std::string name;
  Mesh a, b;  ///< now
  double thickness = 0.125;
  Eigen::Vector3d aCameBy{0, 0, -0.5};  ///< displacement of a in the step
  Eigen::Vector3d bCameBy{0, 0, 0};
  bool large = false;  ///< too many features for brute force on a mesh with itself

  std::vector<Eigen::Vector3d> aBefore() const { return before(a, aCameBy); }
  std::vector<Eigen::Vector3d> bBefore() const { return before(b, bCameBy); }

 private:
  static std::vector<Eigen::Vector3d> before(const Mesh& mesh, const Eigen::Vector3d& cameBy) {
    std::vector<Eigen::Vector3d> positions = mesh.positions;
    for (Eigen::Vector3d& p : positions) p -= cameBy;
    return positions;
  }
};

/// Adds one triangle with three new vertices.
inline void addTriangle(Mesh& mesh, const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                        const Eigen::Vector3d& c) {
  const auto first = static_cast<std::uint32_t>(mesh.positions.size());
  mesh.positions.insert(mesh.positions.end(), {a, b, c});
  mesh.triangles.push_back({first, first + 1, first + 2});
}

inline Mesh moved(Mesh mesh, const Eigen::Vector3d& by, double scale = 1.0) {
  for (Eigen::Vector3d& p : mesh.positions) p = scale * p + by;
  return mesh;
}

/// The unit square at height z, exactly flat, in 2 n² triangles.
inline Mesh flat(std::uint32_t n, double z) {
  Mesh mesh = sheet(n, 0, 0);
  for (Eigen::Vector3d& p : mesh.positions) p.z() = z;
  return mesh;
}

inline Mesh unwelded(const Mesh& mesh) {
  Mesh out;
  for (const auto& [a, b, c] : mesh.triangles)
    addTriangle(out, mesh.positions[a], mesh.positions[b], mesh.positions[c]);
  return out;
}

/// A tetrahedron that stands on its tip.
inline Mesh spike(const Eigen::Vector3d& tip, double size = 0.25) {
  Mesh mesh;
  mesh.positions = {tip, tip + Eigen::Vector3d(size, 0, size), tip + Eigen::Vector3d(0, size, size),
                    tip + Eigen::Vector3d(-size, -size, size)};
  mesh.triangles = {{0, 2, 1}, {0, 3, 2}, {0, 1, 3}, {1, 2, 3}};
  return mesh;
}

namespace degenerate {

using Eigen::Vector3d;

inline Mesh zeroAreaTriangles() {
  Mesh mesh = flat(2, 0.0625);
  addTriangle(mesh, {0, 0, 0}, {0.5, 0.5, 0}, {1, 1, 0});
  addTriangle(mesh, {1, 1, 0}, {0, 0, 0}, {0.25, 0.25, 0});
  addTriangle(mesh, {0.5, 0, 0}, {0.5, 0, 0}, {0.5, 1, 0});
  addTriangle(mesh, {0.25, 0.5, 0}, {0.25, 0.5, 0}, {0.25, 0.5, 0});
  return mesh;
}

inline Mesh repeatedIndices() {
  Mesh mesh = flat(2, 0.03125);
  for (const Triangle& triangle : {Triangle{0, 0, 1}, Triangle{2, 4, 2}, Triangle{5, 3, 3},
                                   Triangle{4, 4, 4}, Triangle{0, 4, 8}})
    mesh.triangles.push_back(triangle);
  return mesh;
}

inline Mesh duplicateTriangles() {
  Mesh mesh = flat(2, 0);
  const std::vector<Triangle> once = mesh.triangles;
  for (const auto& [a, b, c] : once) {
    mesh.triangles.push_back({b, c, a});
    mesh.triangles.push_back({c, b, a});
  }
  return mesh;
}

/// Folded over on itself along x = 0.5, the halves in one plane.
inline Mesh folded() {
  Mesh mesh = flat(4, 0);
  for (Vector3d& p : mesh.positions) p.x() = std::min(p.x(), 1 - p.x());
  return mesh;
}

/// Triangles about edges on the x axis: overlapping, end to end, apart.
inline Mesh alongX(double first, double y, double z, double up) {
  Mesh mesh;
  for (int i = 0; i < 3; ++i) {
    const double x = first + i;
    addTriangle(mesh, {x, y, z}, {x + 0.75, y, z}, {x + 0.25, y + 0.5, z + up});
  }
  return mesh;
}

inline Mesh slivers(double width) {
  Mesh mesh;
  for (int i = 0; i < 6; ++i) {
    const double y = 0.15 * i;
    addTriangle(mesh, {-1, y, 0}, {1, y + width, 0.01}, {0, y + width / 2, width});
    addTriangle(mesh, {y, -1, 0.01}, {y, 1, 0}, {y + width, 1, width});
  }
  return mesh;
}

inline Mesh hugeAndTiny() {
  Mesh mesh;
  addTriangle(mesh, {-1e9, -1e9, 0.01}, {1e9, -1e9, 0.01}, {0, 1e9, 0.01});
  append(mesh, flat(2, 0.0));
  append(mesh, moved(flat(2, 0.0), {0.3, 0.3, 0.005}, 1e-9));
  append(mesh, moved(flat(2, 0.0), {0.6, 0.3, 0.005}, 1e-15));
  addTriangle(mesh, {0.5, 0.5, -1e12}, {0.5, 0.5, 1e12}, {0.75, 0.5, 0});
  return mesh;
}

/// Triangles with corners on the lattice of eighths, whole cells and their halves, and corners of
/// the cube itself.
inline Mesh onCellBorders() {
  Mesh mesh;
  for (int i = 0; i <= 8; i += 2)
    for (int j = 0; j <= 8; j += 4) {
      const double x = i / 8.0, y = j / 8.0;
      const double dx = i == 8 ? -0.125 : 0.125, dy = j == 8 ? -0.125 : 0.125;
      addTriangle(mesh, {x, y, 0}, {x + dx, y, 0}, {x, y + dy, 0});
      addTriangle(mesh, {x, y, 1}, {x + dx, y, 1}, {x, y, 0.875});
      addTriangle(mesh, {x, y, 0.5}, {x + 2 * dx, y, 0.5}, {x, y + 4 * dy, 0.5});
    }
  return mesh;
}

/// 65,537 vertices, all in triangles.
inline Mesh moreThanSixteenBits() {
  Mesh mesh = sheet(255, 0, 0);
  mesh.positions.push_back({0.5, 0.5, 0.3});
  mesh.triangles.push_back({65534, 65535, 65536});
  return mesh;
}

inline Mesh denormal(double unit) {
  Mesh mesh = flat(4, 0);
  append(mesh, spike({0.25, 0.25, 0.5}));
  for (Vector3d& p : mesh.positions) p *= 64 * unit;
  return mesh;
}

}  // namespace degenerate

/// The degenerate cases. Every method gives the same contacts for them as brute force does.
inline std::vector<DegenerateCase> degenerateCases() {
  using namespace degenerate;
  const double denorm = std::numeric_limits<double>::denorm_min();
  const Mesh sheet2 = flat(2, 0), sheet3 = flat(3, 0), sheet4 = flat(4, 0), none;
  Mesh one, twins, copies, strewn = flat(2, 0), twoLayers = flat(3, 0), far = flat(3, 0.0625);
  addTriangle(one, {0, 0, 0}, {1, 0, 0}, {0, 1, 0});
  twins.positions = one.positions;
  twins.triangles.assign(24, {0, 1, 2});
  for (int i = 0; i < 20; ++i) append(copies, one);
  strewn.positions.insert(strewn.positions.end(), {{0.5, 0.5, 0}, {1e300, -1e300, 0}, {0, 0, 0}});
  append(twoLayers, flat(2, 0));
  far.positions[5] = {1e12, 1e12, -1e12};
  Mesh hinge;
  hinge.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0.5, 0}};
  hinge.triangles = {{0, 1, 2}, {1, 0, 3}};
  const Mesh ball = sphere(6, 8, {0, 0, 0}, 1.0), core = sphere(5, 7, {0.05, 0, 0}, 0.5);
  Mesh points;
  points.positions.assign(30, {1, 2, 3});
  for (std::uint32_t t = 0; t < 10; ++t) points.triangles.push_back({3 * t, 3 * t + 1, 3 * t + 2});

  return {
      {.name = "zero-area triangles", .a = zeroAreaTriangles(), .b = sheet3},
      {.name = "only zero-area triangles", .a = points, .b = moved(points, {0, 0, 0})},
      {.name = "repeated indices in a triangle", .a = repeatedIndices(), .b = sheet3},
      {.name = "duplicate vertices with distinct indices", .a = unwelded(sheet3), .b = sheet3},
      {.name = "duplicate triangles", .a = duplicateTriangles(), .b = moved(sheet2, {0, 0, 0.125})},
      {.name = "coplanar overlaps", .a = twoLayers, .b = moved(sheet4, {0.125, 0.25, 0})},
      {.name = "an edge folded by 180 degrees", .a = hinge, .b = folded()},
      {.name = "vertex exactly on face", .a = spike({0.125, 0.0625, 0}), .b = sheet2},
      {.name = "vertex exactly on edge", .a = spike({0.25, 0.25, 0}), .b = sheet2},
      {.name = "vertex exactly on vertex", .a = spike({0.5, 0.5, 0}), .b = sheet2},
      {.name = "parallel edges", .a = alongX(0, 0, 0, 1), .b = alongX(0.25, 0, -0.0625, -1)},
      {.name = "collinear edges", .a = alongX(0, 0, 0, 1), .b = alongX(0.75, 0, 0, -1)},
      {.name = "slivers of 1e-12", .a = slivers(1e-12), .b = moved(sheet3, {0, 0, 0.005})},
      {.name = "huge and tiny triangles in one mesh",
       .a = hugeAndTiny(),
       .b = moved(sheet2, {0.25, 0.25, 0.0625})},
      {.name = "one vertex far away", .a = far, .b = sheet3},
      {.name = "denormal coordinates",
       .a = denormal(denorm),
       .b = denormal(denorm),
       .thickness = 8 * denorm,
       .aCameBy = {0, 0, 30 * denorm}},
      {.name = "among the smallest normals",
       .a = denormal(0x1p-1026),
       .b = denormal(0x1p-1026),
       .thickness = 0x1p-1024,
       .aCameBy = {0, 0, 0x1p-1022}},
      {.name = "beyond float's range",
       .a = moved(spike({0.25, 0.25, 0}), {0, 0, 0}, 0x1p600),
       .b = moved(sheet2, {0, 0, 0}, 0x1p600),
       .thickness = 0x1p597,
       .aCameBy = {0, 0, -0x1p600}},
      {.name = "empty mesh", .a = none, .b = sheet2},
      {.name = "two empty meshes", .a = none, .b = none},
      {.name = "one triangle", .a = one, .b = moved(one, {0.25, 0.25, 0.0625})},
      {.name = "one triangle twice named", .a = twins, .b = twins},
      {.name = "all elements identical", .a = copies, .b = copies},
      {.name = "cell borders and root corners",
       .a = onCellBorders(),
       .b = moved(onCellBorders(), {0.125, 0, 0})},
      {.name = "one closed mesh inside another", .a = core, .b = ball},
      {.name = "one closed mesh inside another, reached",
       .a = core,
       .b = ball,
       .thickness = 0.5,
       .aCameBy = {0.75, 0, 0}},
      {.name = "vertices in no triangle", .a = strewn, .b = moved(sheet2, {0, 0, 0.0625})},
      {.name = "a step without motion",
       .a = spike({0.25, 0.125, -0.0625}),
       .b = sheet4,
       .aCameBy = {0, 0, 0}},
      {.name = "impact exactly at 0",
       .a = spike({0.25, 0.125, 0.5}),
       .b = sheet4,
       .aCameBy = {0, 0, 0.5}},
      {.name = "impact exactly at 1", .a = spike({0.25, 0.125, 0}), .b = sheet4},
      {.name = "edges that meet exactly at 1",
       .a = alongX(0, 0, 0, 1),
       .b = moved(flat(2, 0), {0.25, -0.5, 0})},
      {.name = "motion in the common plane",
       .a = sheet2,
       .b = moved(sheet3, {1, 0.25, 0}),
       .aCameBy = {0.5, 0, 0}},
      {.name = "both move alike",
       .a = spike({0.25, 0.125, 0}),
       .b = sheet4,
       .aCameBy = {1e6, 1, 1},
       .bCameBy = {1e6, 1, 1}},
      {.name = "65,537 vertices",
       .a = moreThanSixteenBits(),
       .b = moved(spike({0, 0, 0}, 0.02), {0.5, 0.5, 0.25}),
       .thickness = 0.0078125,
       .aCameBy = {0, 0, 0.0625},
       .large = true},
  };
}

/// Splits an edge on the side of one of its two triangles. A triangle without area closes the
/// surface: at the middle of the edge, or at its start, where one more vertex then is.
inline void addFlatTriangles(Random& random, Mesh& mesh) {
  std::vector<Triangle>& triangles = mesh.triangles;
  const auto added = static_cast<std::uint32_t>(mesh.positions.size());
  const std::size_t at = random() % triangles.size(), first = random() % 3;
  const Triangle t = triangles[at];
  const std::uint32_t p = t[first], q = t[(first + 1) % 3], r = t[(first + 2) % 3];
  if (random() % 2 != 0) {
    mesh.positions.push_back(0.5 * (mesh.positions[p] + mesh.positions[q]));
    triangles[at] = {p, added, r};
    triangles.insert(triangles.end(), {{added, q, r}, {q, added, p}});
  } else {
    mesh.positions.push_back(mesh.positions[p]);
    triangles[at] = {added, q, r};
    triangles.insert(triangles.end(), {{q, added, p}, {added, r, p}});
  }
}

}  // namespace palpate::testing
