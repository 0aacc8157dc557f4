#include <palpate/DistanceField.h>
#include <palpate/OctreeBasedCD.h>

#include "Common/Sanitized.h"
#include "FieldPoints.h"
#include "Math/SolidAngle.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <utility>

/// Fields of meshes that are not closed and consistently oriented.
namespace palpate::testing {
namespace {

using Eigen::Vector3d;

double windingNumber(const Mesh& mesh, const Vector3d& p) {
  double sum = 0.0;
  for (const auto& [a, b, c] : mesh.triangles)
    sum += solidAngleShare(p, mesh.positions[a], mesh.positions[b], mesh.positions[c]).value;
  return sum;
}

Mesh hemisphere() {
  Mesh mesh = sphere(20, 30, {0, 0, 0}, 1.0);
  std::erase_if(mesh.triangles, [&](const Triangle& t) {
    return (mesh.positions[t[0]] + mesh.positions[t[1]] + mesh.positions[t[2]])[2] < 0;
  });
  return mesh;
}

std::vector<NamedMesh> openMeshes() {
  std::vector<NamedMesh> meshes{{"hemisphere", hemisphere()}};
  Mesh patch = sheet(4, 0.0, 0.0);
  for (Vector3d& p : patch.positions) p.z() = 0.0;
  meshes.push_back({"patch", patch});
  Mesh crossing = sphere(9, 12, {0, 0, 0}, 1.0);
  append(crossing, boxMesh({0.2, -0.3, -0.4}, {1.4, 0.3, 0.4}));
  crossing.triangles.pop_back();
  meshes.push_back({"crossing", crossing});
  Mesh holed = sphere(12, 16, {0.1, 0.2, 0.3}, 1.0);
  holed.triangles.erase(holed.triangles.begin() + 100);
  meshes.push_back({"holed", holed});
  Mesh inverted = boxMesh({-1, -1, -1}, {1, 1, 1});
  std::swap(inverted.triangles[3][1], inverted.triangles[3][2]);
  meshes.push_back({"inverted triangle", inverted});
  meshes.push_back({"one triangle", {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}}});
  return meshes;
}

/// The error bound of fine fields, as a part of the diagonal. Sanitizers build coarser ones.
constexpr double kFine = kShareOfCases == 1 ? 0.01 : 0.03;

/// Points with a winding number of about 1/2 in magnitude, away from the triangles.
void addPointsOfSheet(Random& random, const Mesh& mesh, std::size_t count,
                      std::vector<Vector3d>& out) {
  const Extent extent = extentOf(mesh);
  const auto isInside = [&](const Vector3d& p) { return std::abs(windingNumber(mesh, p)) > 0.5; };
  const auto randomly = [&] {
    Vector3d p;
    for (int k = 0; k < 3; ++k)
      p[k] = uniform(random, extent.box.min()[k] - 0.1, extent.box.max()[k] + 0.1);
    return p;
  };
  for (std::size_t i = 0; i < count; ++i) {
    Vector3d inside = randomly(), outside = randomly();
    if (!isInside(inside) || isInside(outside)) continue;
    for (int n = 0; n < 40; ++n) {
      const Vector3d middle = 0.5 * (inside + outside);
      (isInside(middle) ? inside : outside) = middle;
    }
    out.push_back(inside), out.push_back(outside);
  }
}

/// Points on and near edges that belong to one triangle only.
void addPointsOfRim(Random& random, const Mesh& mesh, const DistanceField& field, std::size_t count,
                    std::vector<Vector3d>& out) {
  const MeshDefects defects = findMeshDefects(mesh.triangles);
  std::vector<Segment> edges = defects.open;
  edges.insert(edges.end(), defects.flipped.begin(), defects.flipped.end());
  for (std::size_t i = 0; i < count && !edges.empty(); ++i) {
    const auto& [a, b] = edges[random() % edges.size()];
    const double t = uniform(random, 0, 1),
                 size = std::ldexp(field.band(), -static_cast<int>(random() % 12));
    out.push_back(mesh.positions[a] + t * (mesh.positions[b] - mesh.positions[a]));
    if (random() % 3 != 0) out.back() += size * randomPoint(random, -1, 1);
  }
}

struct Tally {
  std::size_t reliable = 0, unreliable = 0, inside = 0, nearInteger = 0, nearIntegerReliable = 0;
};

Tally expectHolds(Random& random, const Mesh& mesh, const DistanceField& field, std::size_t count) {
  OctreeBasedCD collisions;
  const GeometryId body = collisions.addTriangleMesh(mesh.positions, mesh.triangles);
  std::vector<Vector3d> points = adversarialPoints(random, mesh, field, count);
  addPointsOfSheet(random, mesh, count / 10, points);
  addPointsOfRim(random, mesh, field, count / 4, points);
  std::vector<double> values(points.size());
  field.values(points, values);
  Tally tally;
  int faults = 0;
  for (std::size_t i = 0; i < points.size() && faults < 5; ++i) {
    const double distance = collisions.queries().closestPoint(body, points[i])->distance,
                 number = windingNumber(mesh, points[i]), value = values[i], size = std::abs(value),
                 defect = std::abs(number - std::round(number));
    const bool isReliable = field.signIsReliable(points[i]), isInside = std::abs(number) > 0.5,
               isInBand = distance <= field.band();
    bool holds = isInBand ? std::abs(size - distance) <= field.errorBound()
                          : size <= distance && size >= field.band() - field.errorBound();
    // On a triangle the winding number is not defined.
    const bool isOnSurface = distance < 1e-12;
    if (!isReliable) {
      holds &= value >= 0;
    } else if (!isOnSurface) {
      holds &= defect < 0.375 + 1e-9;
      if (isInBand)
        holds &= std::abs(value - (isInside ? -distance : distance)) <= field.errorBound();
      else
        holds &= (value < 0) == isInside;
    }
    EXPECT_EQ(value, field.value(points[i]));
    EXPECT_TRUE(holds) << "at " << points[i].transpose() << ": " << value << ", exact " << distance
                       << ", winding number " << number << ", reliable " << isReliable;
    faults += !holds;
    ++(isReliable ? tally.reliable : tally.unreliable);
    tally.inside += value < 0;
    if (isOnSurface || !isInBand || defect > 0.15) continue;
    ++tally.nearInteger;
    tally.nearIntegerReliable += isReliable;
  }
  return tally;
}

}  // namespace

TEST(OpenField, IsWithinItsBoundAndKnowsItsSign) {
  Random random(11);
  for (const auto& [name, mesh] : openMeshes()) {
    SCOPED_TRACE(name);
    constexpr std::pair<double, double> kBounds[] = {{0.04, 0.1}, {0.01, 0.03}, {0.05, 0.3}};
    for (int i = 0; i < casesOf(3); ++i) {
      SCOPED_TRACE(kBounds[i].first);
      const DistanceField field = fieldOf(mesh, kBounds[i].first, kBounds[i].second);
      EXPECT_FALSE(field.isClosed());
      const Tally tally = expectHolds(random, mesh, field, casesOf(4000));
      EXPECT_GT(tally.unreliable, 0u);
      const bool enclosesNothing = name == "patch" || name == "one triangle";
      EXPECT_EQ(tally.inside == 0, enclosesNothing);
      if (enclosesNothing) continue;
      EXPECT_GT(tally.reliable, tally.unreliable);
      EXPECT_GT(tally.nearIntegerReliable, tally.nearInteger / 2);
    }
  }
}

/// The law of signIsReliable().
TEST(OpenField, HasTheSignOfEveryPatchThatIsNotTooWide) {
  Random random(12);
  const Mesh mesh = hemisphere();
  const DistanceField field = fieldOf(mesh, kFine, 0.05);
  std::size_t compared = 0;
  for (const double depth : {0.0, 0.6, -0.6}) {
    // A cone over the rim, with its tip below or above the hole.
    Mesh patch{mesh.positions, {}};
    patch.positions.emplace_back(0, 0, -depth);
    for (const Triangle& t : mesh.triangles)
      for (int i = 0; i < 3; ++i) {
        const std::uint32_t a = t[i], b = t[(i + 1) % 3];
        const auto goesBack = [&](const Triangle& other) {
          for (int k = 0; k < 3; ++k)
            if (other[k] == b && other[(k + 1) % 3] == a) return true;
          return false;
        };
        if (std::none_of(mesh.triangles.begin(), mesh.triangles.end(), goesBack))
          patch.triangles.push_back({b, a, static_cast<std::uint32_t>(mesh.positions.size())});
      }
    for (const Vector3d& p : adversarialPoints(random, mesh, field, casesOf(10000))) {
      if (!field.signIsReliable(p) || std::abs(windingNumber(patch, p)) > 0.625) continue;
      const double number = windingNumber(mesh, p) + windingNumber(patch, p);
      if (std::abs(field.value(p)) <= field.errorBound()) continue;
      ASSERT_NEAR(number, std::round(number), 1e-6);
      EXPECT_EQ(field.value(p) < 0, std::abs(number) > 0.5) << p.transpose();
      ++compared;
    }
  }
  EXPECT_GE(compared, leastOf(1000));
}

TEST(OpenField, IsReliableFarAway) {
  Random random(13);
  // The winding number is about 3/2 in magnitude on both sides of three patches.
  std::vector<NamedMesh> meshes = openMeshes();
  meshes.push_back({"three patches", meshes[1].mesh});
  append(meshes.back().mesh, meshes[1].mesh);
  append(meshes.back().mesh, meshes[1].mesh);
  for (const auto& [name, mesh] : meshes) {
    SCOPED_TRACE(name);
    const DistanceField field = fieldOf(mesh, 0.04, 0.1);
    EXPECT_TRUE(field.signIsReliable({1e3, 0, 0}));
    EXPECT_TRUE(field.signIsReliable({0, 1e300, -1e300}));
    std::size_t reliable = 0;
    for (int i = 0; i < casesOf(2000); ++i) {
      Vector3d p = randomPoint(random, -1, 1);
      p *= random() % 2 ? 12.0 : 2.0;
      if (extentOf(mesh).box.exteriorDistance(p) < 2 * field.band()) continue;
      if (!field.signIsReliable(p)) continue;
      ++reliable;
      EXPECT_LT(std::abs(windingNumber(mesh, p)), 0.375) << p.transpose();
      EXPECT_GT(field.value(p), 0.0);
    }
    EXPECT_GE(reliable, leastOf(100));
  }
}

TEST(OpenField, CountsVerticesAtOnePlaceAsOne) {
  Random random(14);
  const Mesh torus = torusMesh(24, 12);
  Mesh apart;
  for (const Triangle& t : torus.triangles) {
    const auto first = static_cast<std::uint32_t>(apart.positions.size());
    for (const std::uint32_t v : t) apart.positions.push_back(torus.positions[v]);
    apart.triangles.push_back({first, first + 1, first + 2});
  }
  const DistanceField field = fieldOf(apart, 0.02, 0.05), closed = fieldOf(torus, 0.02, 0.05);
  EXPECT_FALSE(field.isClosed());
  EXPECT_TRUE(closed.isClosed());
  for (const Vector3d& p : adversarialPoints(random, torus, closed, casesOf(5000))) {
    EXPECT_TRUE(field.signIsReliable(p));
    EXPECT_EQ(field.value(p), closed.value(p));
  }
}

/// Contacts of points and triangles with a bowl.
TEST(OpenField, ListsContactsWithoutAReliableSign) {
  Random random(15);
  const Mesh bowl = hemisphere(), loose = soup(random, 60, 0.4);
  const auto field = std::make_shared<const DistanceField>(fieldOf(bowl, kFine, 0.1));
  std::vector<Vector3d> points(casesOf(3000));
  for (Vector3d& p : points) p = randomPoint(random, -1.1, 1.1);
  constexpr double kThickness = 0.1;
  for (const bool isMesh : {false, true}) {
    OctreeBasedCD detection(Settings{.threads = 1});
    const GeometryId other = isMesh ? detection.addTriangleMesh(loose.positions, loose.triangles)
                                    : detection.addPointSet(points),
                     body = detection.addDistanceField(field);
    detection.addCollisionPair(other, body,
                               {.method = Method::DistanceField, .thickness = kThickness});
    detection.detectCollision();
    const CollisionData& data = detection.collisionData(other, body);
    std::vector<std::uint32_t> unreliable;
    std::size_t inside = 0;
    for (std::uint32_t i = 0; i < data.shape().size(); ++i) {
      const ShapeContact& contact = data.shape()[i];
      EXPECT_LE(contact.distance, kThickness);
      inside += contact.distance < 0;
      if (!field->signIsReliable(contact.point)) unreliable.push_back(i);
    }
    EXPECT_EQ(data.validity().unreliableSign, unreliable);
    EXPECT_GE(unreliable.size(), leastOf(6));
    EXPECT_GE(inside, leastOf(6));
    if (isMesh) continue;
    std::size_t expected = 0;
    for (const Vector3d& p : points) expected += field->value(p) <= kThickness;
    EXPECT_EQ(data.shape().size(), expected);
  }
}

/// Triangles that reach into a bowl through its hole are contacts, although their corners may be
/// far away from it by the field.
TEST(OpenField, MissesNoTriangleInside) {
  Random random(16);
  const Mesh bowl = hemisphere(), loose = soup(random, static_cast<std::size_t>(casesOf(300)), 0.9);
  const auto field = std::make_shared<const DistanceField>(fieldOf(bowl, kFine, 0.2));
  constexpr double kThickness = 0.02;
  OctreeBasedCD detection(Settings{.threads = 1});
  const GeometryId other = detection.addTriangleMesh(loose.positions, loose.triangles),
                   body = detection.addDistanceField(field);
  detection.addCollisionPair(
      other, body,
      {.method = Method::DistanceField, .thickness = kThickness, .contacts = Contacts::All});
  detection.detectCollision();
  std::vector<bool> isContact(loose.triangles.size());
  for (const ShapeContact& contact : detection.collisionData(other, body).shape())
    if (contact.element == ShapeElement::Face) isContact[contact.id] = true;
  std::size_t found = 0, missing = 0;
  for (std::size_t t = 0; t < loose.triangles.size(); ++t) {
    const auto& [a, b, c] = loose.triangles[t];
    double least = kInfinity;
    for (int i = 0; i < 300; ++i) {
      const double u = uniform(random, 0, 1), v = uniform(random, 0, 1 - u);
      least = std::min(
          least, field->value(loose.positions[a] + u * (loose.positions[b] - loose.positions[a]) +
                              v * (loose.positions[c] - loose.positions[a])));
    }
    if (least > kThickness - 0.5 * field->errorBound()) continue;
    ++found;
    missing += !isContact[t];
  }
  EXPECT_GE(found, leastOf(30));
  EXPECT_EQ(missing, 0u);
}

}  // namespace palpate::testing
