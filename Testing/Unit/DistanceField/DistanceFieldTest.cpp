#include <palpate/DistanceField.h>
#include <palpate/OctreeBasedCD.h>

#include "Common/EverySimdPath.h"
#include "Common/ExpectRefused.h"
#include "Common/FailingAllocation.h"
#include "Common/Sanitized.h"
#include "Common/TemporaryFolder.h"
#include "DistanceField/FieldCells.h"
#include "FieldPoints.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>

namespace palpate::testing {
namespace {

namespace fs = std::filesystem;

/// Compares with exact distances. Returns how often distanceBound() exceeds the value.
std::size_t expectWithinBound(Random& random, const Mesh& mesh, const DistanceField& field,
                              std::size_t count) {
  OctreeBasedCD collisions;
  const GeometryId body = collisions.addTriangleMesh(mesh.positions, mesh.triangles);
  const std::vector<Eigen::Vector3d> points = adversarialPoints(random, mesh, field, count);
  std::vector<SignedDistance> exact(count);
  collisions.queries().signedDistances(body, points, exact);
  std::vector<double> values(count);
  field.values(points, values);
  std::size_t inBand = 0, faults = 0, furtherThanBand = 0;
  for (std::size_t i = 0; i < count && faults < 5; ++i) {
    const double d = exact[i].distance, value = values[i];
    const bool isInBand = std::abs(d) <= field.band();
    const bool holds = isInBand ? std::abs(value - d) <= field.errorBound()
                                : (value > 0) == (d > 0) && std::abs(value) <= std::abs(d) &&
                                      std::abs(value) >= field.band() - field.errorBound();
    inBand += isInBand;
    faults += !holds;
    EXPECT_TRUE(holds) << "at " << points[i].transpose() << ": " << value << ", exact " << d
                       << ", bound " << field.errorBound() << ", band " << field.band();
    EXPECT_EQ(value, field.value(points[i]));
    const double bound = DistanceField::Implementation::lookupOf(field).distanceBound(points[i]);
    EXPECT_GE(bound, value);
    if (d > 0) {
      EXPECT_LE(bound, isInBand ? d + field.errorBound() : d);
    }
    furtherThanBand += bound > value;
  }
  EXPECT_GT(inBand, count / 4);
  return furtherThanBand;
}

void write(const fs::path& path, const std::string& content) {
  fs::remove(path);  // some file systems wait for the disk when a file is overwritten
  std::ofstream(path, std::ios::binary) << content;
}

std::string bytesOf(const DistanceField& field) {
  const fs::path file =
      fs::path(::testing::TempDir()) / ("palpate-field" + std::to_string(::getpid()));
  field.save(file);
  const std::string bytes = contentOf(file);
  fs::remove(file);
  return bytes;
}

void setChecksum(std::string& content) {
  std::uint64_t sum = 0xcbf29ce484222325u;
  for (std::size_t i = 0; i + 8 < content.size(); ++i)
    sum = (sum ^ static_cast<unsigned char>(content[i])) * 0x100000001b3u;
  for (int i = 0; i < 8; ++i)
    content[content.size() - 8 + i] = static_cast<char>(sum >> 8 * i & 0xff);
}

/// A field with blocks and leaves whose file is small.
Mesh needle() { return boxMesh({0, 0, 0}, {1, 0.05, 0.05}); }
DistanceField smallField() { return fieldOf(needle(), 0.2, 0.2); }
Mesh without(Mesh mesh, std::size_t triangle) {
  mesh.triangles.erase(mesh.triangles.begin() + static_cast<std::ptrdiff_t>(triangle));
  return mesh;
}

}  // namespace

TEST(DistanceField, IsWithinItsBoundEverywhere) {
  Random random(1);
  for (const auto& [name, mesh] : fieldMeshes(random)) {
    SCOPED_TRACE(name);
    constexpr std::pair<double, double> kBounds[] = {{0.04, 0.1}, {0.008, 0.02}, {0.05, 0.3}};
    for (int i = 0; i < casesOf(3); ++i) {
      const auto [errorBound, band] = kBounds[i];
      SCOPED_TRACE(errorBound);
      const DistanceField field = fieldOf(mesh, errorBound, band);
      EXPECT_GT(field.cells(), 0u);
      expectWithinBound(random, mesh, field, casesOf(10000));
    }
  }
}

TEST(DistanceField, HoldsOnRandomStars) {
  Random random(2);
  std::size_t furtherThanBand = 0;
  for (int i = 0; i < casesOf(20); ++i) {
    Mesh mesh = starMesh(random);
    const Eigen::Vector3d shift = randomPoint(random, -100, 100);
    for (Eigen::Vector3d& p : mesh.positions) p += shift;
    furtherThanBand +=
        expectWithinBound(random, mesh, fieldOf(mesh, uniform(random, 0.02, 0.1), 0.05), 3000);
  }
  EXPECT_GT(furtherThanBand, 0);
}

TEST(DistanceField, IsContinuousAcrossCells) {
  Random random(3);
  for (const auto& [name, mesh] : fieldMeshes(random)) {
    if (name == "far") continue;  // a step of one double is larger than the jump
    SCOPED_TRACE(name);
    const DistanceField field = fieldOf(mesh, 0.04, 0.1);
    const double unit = unitOf(mesh, field);
    for (const Eigen::Vector3d& point : adversarialPoints(random, mesh, field, casesOf(20000))) {
      Eigen::Vector3d p = point;
      const int axis = static_cast<int>(random() % 3);
      const double side = std::ldexp(unit, -static_cast<int>(random() % 7));
      p[axis] = std::round(p[axis] / side) * side;
      Eigen::Vector3d below = p;
      below[axis] = std::nextafter(p[axis], -std::numeric_limits<double>::infinity());
      ASSERT_NEAR(field.value(p), field.value(below), 0x1p-20 * field.band()) << p.transpose();
    }
  }
}

TEST(DistanceField, GradientIsThatOfTheValue) {
  Random random(4);
  const Mesh mesh = torusMesh(24, 12);
  const DistanceField field = fieldOf(mesh, 0.03, 0.1);
  const double step = 1e-7;
  int compared = 0;
  for (const Eigen::Vector3d& p : adversarialPoints(random, mesh, field, casesOf(5000))) {
    Eigen::Vector3d forward, backward;
    for (int k = 0; k < 3; ++k) {
      const Eigen::Vector3d h = step * Eigen::Vector3d::Unit(k);
      forward[k] = (field.value(p + h) - field.value(p)) / step;
      backward[k] = (field.value(p) - field.value(p - h)) / step;
    }
    if ((forward - backward).norm() > 1e-6) continue;  // it jumps here
    ++compared;
    ASSERT_LT((field.gradient(p) - forward).norm(), 1e-5) << p.transpose();
  }
  EXPECT_GT(compared, casesOf(2000));
  const Eigen::Vector3d away = field.gradient({100, 0, 0});
  EXPECT_EQ(away, Eigen::Vector3d(1, 0, 0));
}

TEST(DistanceField, IsALowerBoundFarAway) {
  const Mesh mesh = boxMesh({-1, -1, -1}, {1, 1, 1});
  const DistanceField field = fieldOf(mesh, 0.05, 0.05);
  EXPECT_LE(field.value({1e6, 0, 0}), 1e6 - 1);
  EXPECT_GT(field.value({1e6, 0, 0}), 1e6 - 2);
  EXPECT_LE(field.value({1e300, 1e300, 0}), std::sqrt(2.0) * 1e300);
  EXPECT_EQ(field.value({0, 0, 0}), -field.band());
}

TEST(DistanceField, DoesNotDependOnThreadsOrInstructions) {
  Random random(5);
  const Mesh star = starMesh(random);
  for (const Mesh& mesh : {star, without(star, 20)}) {
    const std::string expected = bytesOf(fieldOf(mesh, 0.05, 0.1, 1));
    for (const int threads : {2, 3, 8})
      EXPECT_EQ(bytesOf(fieldOf(mesh, 0.05, 0.1, threads)), expected);
    const DistanceField field = fieldOf(mesh, 0.05, 0.1);
    const auto points = adversarialPoints(random, mesh, field, 1001);
    for (const std::string& path : EverySimdPath()) {
      EXPECT_EQ(bytesOf(fieldOf(mesh, 0.05, 0.1)), expected) << path;
      std::vector<double> values(points.size());
      field.values(points, values);
      for (std::size_t i = 0; i < points.size(); ++i)
        ASSERT_EQ(values[i], field.value(points[i])) << path << ", point " << points[i].transpose();
    }
  }
}

TEST(DistanceField, ReportsProgressAndIsCancelled) {
  const Mesh mesh = sphere(20, 30, {0, 0, 0}, 1.0);
  std::vector<double> fractions;
  DistanceFieldSettings settings{.errorBound = 0.02, .band = 0.2};
  settings.progress = [&](double fraction) {
    fractions.push_back(fraction);
    return true;
  };
  DistanceField::build({mesh.positions, mesh.triangles}, settings);
  ASSERT_GT(fractions.size(), 3u);
  EXPECT_TRUE(std::is_sorted(fractions.begin(), fractions.end()));
  EXPECT_GE(fractions.front(), 0.0);
  EXPECT_EQ(fractions.back(), 1.0);
  for (const std::size_t calls : {std::size_t{0}, fractions.size() / 2, fractions.size() - 1}) {
    std::size_t count = 0;
    settings.progress = [&](double) { return count++ < calls; };
    expectRefused(ErrorCode::Cancelled, "cancelled", [&] {
      DistanceField::build({mesh.positions, mesh.triangles}, settings);
    });
    EXPECT_EQ(count, calls + 1);
  }
}

TEST(DistanceField, KeepsItsMemoryLimit) {
  const Mesh mesh = sphere(20, 30, {0, 0, 0}, 1.0);
  DistanceFieldSettings settings{.errorBound = 0.02, .band = 0.2, .memoryLimit = 100000};
  // Each refusal states what is needed next. The last one states what is enough.
  for (int refusals = 0;; ++refusals) {
    ASSERT_LT(refusals, 100);
    try {
      const DistanceField field = DistanceField::build({mesh.positions, mesh.triangles}, settings);
      EXPECT_LT(field.bytes(), settings.memoryLimit);
      EXPECT_GT(refusals, 0);
      break;
    } catch (const Error& error) {
      ASSERT_EQ(error.code(), ErrorCode::MemoryLimit) << error.what();
      const std::string message = error.what(), start = "needs at least ";
      const std::size_t needed = std::stoull(message.substr(message.find(start) + start.size()));
      ASSERT_GT(needed, settings.memoryLimit) << message;
      settings.memoryLimit = needed;
    }
  }
  // The queries' copy of the mesh is there when the first cells are refused.
  const auto peakOf = [&](std::size_t limit) {
    settings.memoryLimit = limit;
    FailingAllocation::arm(0);
    try {
      DistanceField::build({mesh.positions, mesh.triangles}, settings);
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::MemoryLimit);
    }
    FailingAllocation::disarm();
    return FailingAllocation::peakBytes();
  };
  const std::size_t enough = settings.memoryLimit, ofMesh = peakOf(1);
  for (const std::size_t limit : {enough, enough - 1, enough / 2, enough / 7}) {
    EXPECT_LE(peakOf(limit), limit + ofMesh);
    EXPECT_GT(peakOf(limit), limit / 4);
  }
}

/// A value within a bound of more than the band could have the wrong sign beyond the band.
TEST(DistanceField, SignsBeyondTheBandAreRightForEveryErrorBound) {
  Random random(4);
  const Mesh mesh = sphere(20, 30, {0.1, 0.2, 0.3}, 1.0);
  for (const double errorBound : {0.05, 0.1, 0.4, 3.0}) {
    const double band = 0.05;
    const DistanceField field =
        DistanceField::build({mesh.positions, mesh.triangles}, {errorBound, band});
    EXPECT_EQ(field.errorBound(), band);
    expectWithinBound(random, mesh, field, casesOf(20000));
  }
}

TEST(DistanceField, HasARangeOfSizes) {
  const auto build = [](int exponent) {
    const double size = std::ldexp(1.0, exponent);
    const Mesh mesh = boxMesh(Eigen::Vector3d::Constant(-size), Eigen::Vector3d::Constant(size));
    return DistanceField::build({mesh.positions, mesh.triangles}, {0.05 * size, 0.2 * size});
  };
  for (const int exponent : {-397, -300, 300, 397})
    EXPECT_NEAR(build(exponent).value({std::ldexp(0.75, exponent), 0, 0}),
                std::ldexp(-0.2, exponent), std::ldexp(0.05, exponent));
  for (const int exponent : {-1000, -540, -402, 402, 900})
    expectRefused(ErrorCode::InvalidSettings, "from 2^-400 to 2^400", [&] { build(exponent); });
}

/// Between two boxes that nearly touch, cells are as small as the error bound.
TEST(DistanceField, RefusesWhatNeedsFarMoreMemoryBeforeMuchWork) {
  Mesh mesh = boxMesh({-1, -0.5, -0.5}, {-1e-4, 0.5, 0.5});
  append(mesh, boxMesh({1e-4, -0.5, -0.5}, {1, 0.5, 0.5}));
  DistanceFieldSettings settings{.errorBound = 5e-5, .band = 0.1};
  FailingAllocation::arm(0);
  expectRefused(ErrorCode::MemoryLimit, "as estimated", [&] {
    DistanceField::build({mesh.positions, mesh.triangles}, settings);
  });
  FailingAllocation::disarm();
  EXPECT_LT(FailingAllocation::peakBytes(), settings.memoryLimit / 16);
  // The estimate of a build that needs little more or less than the limit.
  if (kShareOfCases > 1) return;  // a large build
  settings.errorBound = 0.004;
  settings.memoryLimit = 0;
  FailingAllocation::arm(0);
  DistanceField::build({mesh.positions, mesh.triangles}, settings);
  FailingAllocation::disarm();
  const auto needed = static_cast<double>(FailingAllocation::peakBytes());
  settings.memoryLimit = static_cast<std::size_t>(2.0 * needed);
  EXPECT_NO_THROW(DistanceField::build({mesh.positions, mesh.triangles}, settings));
  settings.memoryLimit = static_cast<std::size_t>(needed / 8.0);
  expectRefused(ErrorCode::MemoryLimit, "as estimated", [&] {
    DistanceField::build({mesh.positions, mesh.triangles}, settings);
  });
}

TEST(DistanceField, RefusesInvalidInput) {
  const Mesh good = boxMesh({0, 0, 0}, {1, 1, 1});
  const auto build = [](const Mesh& mesh, const DistanceFieldSettings& settings) {
    return [&mesh, settings] { DistanceField::build({mesh.positions, mesh.triangles}, settings); };
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const double value : {0.0, -1.0, nan, std::numeric_limits<double>::infinity()}) {
    expectRefused(ErrorCode::InvalidSettings, "errorBound", build(good, {value, 0.1}));
    expectRefused(ErrorCode::InvalidSettings, "band", build(good, {0.1, value}));
  }
  expectRefused(ErrorCode::InvalidSettings, "2^-18", build(good, {1e-7, 0.1}));
  expectRefused(ErrorCode::InvalidSettings, "threads",
                build(good, {.errorBound = 0.1, .band = 0.1, .threads = -1}));
  const DistanceFieldSettings settings{.errorBound = 0.1, .band = 0.1};
  Mesh bad = good;
  bad.positions[3][1] = nan;
  expectRefused(ErrorCode::NonFinitePosition, "vertex 3", build(bad, settings));
  bad = good;
  bad.triangles[2][1] = 8;
  expectRefused(ErrorCode::IndexOutOfRange, "triangle 2", build(bad, settings));
  bad = good;
  bad.triangles.clear();
  expectRefused(ErrorCode::NotClosed, "no triangles", build(bad, settings));
  bad = good;
  for (Eigen::Vector3d& p : bad.positions) p[0] += 1e13;
  expectRefused(ErrorCode::InvalidSettings, "largest coordinate", build(bad, settings));

  const DistanceField field = fieldOf(good, 0.1, 0.1);
  const std::vector<Eigen::Vector3d> points{{0, 0, 0}, {0, nan, 0}};
  std::vector<double> out(2);
  expectRefused(ErrorCode::NonFinitePosition, "the point", [&] { field.value(points[1]); });
  expectRefused(ErrorCode::NonFinitePosition, "the point", [&] { field.gradient(points[1]); });
  expectRefused(ErrorCode::NonFinitePosition, "point 1", [&] { field.values(points, out); });
  out.resize(1);
  expectRefused(ErrorCode::InvalidSettings, "room for 1", [&] { field.values(points, out); });
  DistanceField moved = field;
  const DistanceField taken = std::move(moved);
  expectRefused(ErrorCode::InvalidCall, "moved from", [&] { moved.value(points[0]); });
}

TEST(DistanceFieldFile, HoldsTheField) {
  Random random(6);
  const TemporaryFolder temporary;
  const fs::path& folder = temporary.path;
  const Mesh star = starMesh(random);
  for (const Mesh& mesh : {without(star, 20), star}) {
    const DistanceField field = fieldOf(mesh, 0.05, 0.1);
    field.save(folder / "field");
    const DistanceField loaded = DistanceField::load(folder / "field");
    EXPECT_EQ(loaded.isClosed(), field.isClosed());
    EXPECT_EQ(loaded.errorBound(), field.errorBound());
    EXPECT_EQ(loaded.band(), field.band());
    EXPECT_EQ(loaded.cells(), field.cells());
    std::size_t reliable = 0, unreliable = 0;
    for (Eigen::Vector3d p : adversarialPoints(random, mesh, field, 2000)) {
      if (random() % 4 == 0) p *= 2;  // often outside the domain
      EXPECT_EQ(loaded.value(p), field.value(p));
      EXPECT_EQ(loaded.gradient(p), field.gradient(p));
      EXPECT_EQ(loaded.signIsReliable(p), field.signIsReliable(p));
      ++(field.signIsReliable(p) ? reliable : unreliable);
    }
    EXPECT_GT(reliable, 0u);
    EXPECT_EQ(unreliable == 0, field.isClosed());
    EXPECT_EQ(bytesOf(loaded), bytesOf(field));
  }
  const DistanceField field = smallField();
  expectRefused(ErrorCode::File, "cannot be read", [&] { DistanceField::load(folder / "none"); });
  expectRefused(ErrorCode::File, "cannot be written",
                [&] { field.save(folder / "none" / "field"); });
}

TEST(DistanceFieldFile, RefusesEveryTruncationAndChangedByte) {
  const TemporaryFolder temporary;
  const fs::path& folder = temporary.path;
  const std::string content = bytesOf(smallField());
  const auto refuse = [&](const std::string& bad) {
    write(folder / "field", bad);
    expectRefused(ErrorCode::File, ", byte ", [&] { DistanceField::load(folder / "field"); });
  };
  for (std::size_t i = 0; i < content.size(); i += kShareOfCases) {
    refuse(content.substr(0, i));
    std::string changed = content;
    changed[i] = static_cast<char>(changed[i] ^ (1 << i % 8));
    refuse(changed);
  }
}

TEST(DistanceFieldFile, SurvivesAnyContentWithAValidChecksum) {
  Random random(7);
  const TemporaryFolder temporary;
  const fs::path& folder = temporary.path;
  const std::array contents{bytesOf(smallField()),
                            bytesOf(fieldOf(without(needle(), 0), 0.2, 0.2))};
  int accepted = 0;
  for (int i = 0; i < casesOf(6000); ++i) {
    const std::string& content = contents[random() % 2];
    std::string changed = content;
    // Half of the changes are in the header, which has the counts.
    const std::size_t range = i % 2 ? 104 : content.size() - 8;
    for (std::uint64_t n = random() % 4 + 1; n > 0; --n)
      changed[random() % range] = static_cast<char>(random());
    setChecksum(changed);
    write(folder / "field", changed);
    try {
      const DistanceField field = DistanceField::load(folder / "field");
      ++accepted;
      for (int p = 0; p < 10; ++p) {
        const Eigen::Vector3d point = randomPoint(random, -0.2, 1.2);
        EXPECT_FALSE(std::isnan(field.value(point)));
        field.gradient(point);
        if (!field.signIsReliable(point)) {
          EXPECT_FALSE(field.isClosed());
        }
      }
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::File);
    }
  }
  EXPECT_GT(accepted, 0);
}

TEST(DistanceField, FilesThatNoBuildWritesAreRefused) {
  const auto load = [](const char* name) {
    return [=] { DistanceField::load(fs::path(PALPATE_SOURCE_DIR) / "Data/Fuzz/Field" / name); };
  };
  expectRefused(ErrorCode::File, "too deep", load("seed-deep"));
  expectRefused(ErrorCode::File, "too wide", load("seed-wide-band"));
  expectRefused(ErrorCode::File, "domain is out of range", load("seed-far"));
  EXPECT_NO_THROW(load("seed-block")());
}

}  // namespace palpate::testing
