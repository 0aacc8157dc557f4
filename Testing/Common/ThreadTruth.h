#pragma once

#include "Unit/Math/ImpactOracle.h"

#include <palpate/ThreadTopology.h>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <span>
#include <tuple>
#include <vector>

namespace palpate::testing {

/// Gauss's linking integral of two closed polygons, a sum of solid angles (Klenin and Langowski,
/// Biopolymers 54, 2000).
inline double linkingIntegral(std::span<const Eigen::Vector3d> a,
                              std::span<const Eigen::Vector3d> b) {
  using Eigen::Vector3d;
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i)
    for (std::size_t k = 0; k < b.size(); ++k) {
      const Vector3d p = a[i], q = a[(i + 1) % a.size()], r = b[k], s = b[(k + 1) % b.size()];
      const auto normal = [](const Vector3d& u, const Vector3d& v) {
        const Vector3d n = u.cross(v);
        return Vector3d(n.norm() > 0 ? n.normalized() : n);
      };
      const Vector3d n[] = {normal(r - p, s - p), normal(s - p, s - q), normal(s - q, r - q),
                            normal(r - q, r - p)};
      double angle = 0;
      for (int m = 0; m < 4; ++m)
        angle += std::asin(std::clamp(n[m].dot(n[(m + 1) % 4]), -1.0, 1.0));
      sum += std::copysign(angle, (s - r).cross(q - p).dot(r - p));
    }
  return sum / (4 * std::numbers::pi);
}

/// A path of ThreadTopology in a step: its vertices, and the positions of all of its geometry.
struct PathStep {
  std::span<const std::uint32_t> vertices;
  std::span<const Eigen::Vector3d> before, now;
};

/// Of an event: whether an end passed, the thread's elements, those of the loop, the change.
using PassageRow =
    std::tuple<bool, std::array<std::uint32_t, 2>, std::array<std::uint32_t, 2>, int>;

/// The passages in a step, by rational arithmetic alone. The loop is a second thread if areParts.
inline std::vector<PassageRow> passageTruth(const PathStep& thread, const PathStep& loop,
                                            bool areParts) {
  std::vector<PassageRow> rows;
  const auto query = [&](bool edges, const auto& ofThread, const auto& ofLoop, auto&& add) {
    impact::Positions p;
    std::size_t i = 0;
    Eigen::AlignedBox3d boxes[2];
    const auto put = [&](const PathStep& path, const auto& vertices, int side) {
      for (const std::uint32_t v : vertices) {
        p[i] = path.before[v], p[4 + i++] = path.now[v];
        boxes[side].extend(path.before[v]).extend(path.now[v]);
      }
    };
    put(thread, ofThread, 0), put(loop, ofLoop, 1);
    if (!boxes[0].intersects(boxes[1])) return;
    for (const auto& passage : impact::Query(edges, p).passages()) add(passage.forward ? 1 : -1);
  };
  const auto &path = thread.vertices, &sides = loop.vertices;
  for (std::size_t i = 0; i + 1 < path.size(); ++i)
    for (std::size_t k = 0; k + (areParts ? 1 : 0) < sides.size(); ++k) {
      const std::array edge{path[i], path[i + 1]}, side{sides[k], sides[(k + 1) % sides.size()]};
      query(true, edge, side, [&](int change) { rows.emplace_back(false, edge, side, change); });
    }
  constexpr std::array kNone{kNoElement, kNoElement};
  const bool isClosed = path.front() == path.back();
  for (const bool isLast : {false, true})
    for (std::size_t k = 1; !isClosed && !areParts && k + 1 < sides.size(); ++k) {
      const std::uint32_t v = isLast ? path.back() : path.front();
      query(false, std::array{v}, std::array{sides[0], sides[k], sides[k + 1]}, [&](int change) {
        rows.emplace_back(true, std::array{v, v}, kNone, isLast ? change : -change);
      });
    }
  std::sort(rows.begin(), rows.end());
  return rows;
}

/// Of the events of one index, all of which must be passages.
inline std::vector<PassageRow> passageRows(std::span<const ThreadEvent> events, std::size_t index) {
  std::vector<PassageRow> rows;
  for (const ThreadEvent& e : events) {
    if (e.index != index) continue;
    EXPECT_TRUE(e.cause == ThreadEvent::Cause::Passed || e.cause == ThreadEvent::Cause::EndPassed)
        << toString(e.cause);
    rows.emplace_back(e.cause == ThreadEvent::Cause::EndPassed, e.thread, e.loop, e.change);
  }
  std::sort(rows.begin(), rows.end());
  return rows;
}

}  // namespace palpate::testing
