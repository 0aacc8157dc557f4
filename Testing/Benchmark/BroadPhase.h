#pragma once

#include <palpate/Types.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <vector>

namespace palpate::benchmark {

/// What every engine is given before the clock starts: which triangles, which meshes against which.
struct Task {
  std::vector<std::vector<Triangle>> meshes;
  std::vector<std::array<std::size_t, 2>>
      pairs;             ///< mesh against mesh; a mesh against itself: self-collision
  double thickness = 0;  ///< L; every box grows by half of it on each side
  int threads = 1;
};

/// One position array per mesh of the task.
using Positions = std::vector<std::vector<Eigen::Vector3d>>;

/// An engine that answers a frame's positions with all pairs of triangles whose boxes overlap, in
/// memory and in the order found. Self-collision: each unordered pair once, a < b, no vertex
/// shared.
class BroadPhase {
 public:
  virtual ~BroadPhase() = default;
  virtual std::string name() const = 0;
  virtual bool rebuilds() const = 0;  ///< from nothing every frame
  virtual void prepare(const Task&, const Positions&) = 0;
  /// A frame: update() to boxes and trees, collide() to pairs. The clock runs over both.
  virtual void update(const Positions&) = 0;
  virtual void collide() = 0;
  /// The last frame's pairs, sorted; outside the clock.
  virtual std::vector<ElementPair> candidates(std::size_t pair) const = 0;
};

std::unique_ptr<BroadPhase> makeEmbreeRefit();
std::unique_ptr<BroadPhase> makeEmbreeMorton();
std::unique_ptr<BroadPhase> makeBullet();
std::unique_ptr<BroadPhase> makeFcl();
std::unique_ptr<BroadPhase> makeCgal();

/// Which points are inside a closed body, with the nearest point of its surface: how long it took
/// without the building of its trees, how many they are, and their depths' sum.
struct InsideAnswer {
  double milliseconds = 0;
  std::size_t inside = 0;
  double depth = 0;
};
InsideAnswer insideByCgal(const std::vector<Eigen::Vector3d>& positions,
                          const std::vector<Triangle>& triangles,
                          const std::vector<Eigen::Vector3d>& points);

/// Pairs found, one list for each mesh pair and thread, so that nothing is shared; keeps its
/// capacity.
class PairLists {
 public:
  void prepare(std::size_t pairs, int threads) {
    m_threads = static_cast<std::size_t>(threads);
    m_lists.assign(pairs * m_threads, {});
  }
  void clear() {
    for (List& list : m_lists) list.pairs.clear();
  }
  std::vector<ElementPair>& of(std::size_t pair, std::size_t thread) {
    return m_lists[pair * m_threads + thread].pairs;
  }
  std::vector<ElementPair> sorted(std::size_t pair) const {
    std::vector<ElementPair> all;
    for (std::size_t i = pair * m_threads; i < (pair + 1) * m_threads; ++i)
      all.insert(all.end(), m_lists[i].pairs.begin(), m_lists[i].pairs.end());
    std::sort(all.begin(), all.end());
    return all;
  }

 private:
  struct alignas(64) List {
    std::vector<ElementPair> pairs;
  };
  std::size_t m_threads = 1;
  std::vector<List> m_lists;
};

inline bool shareVertex(const Triangle& s, const Triangle& t) {
  return s[0] == t[0] || s[0] == t[1] || s[0] == t[2] || s[1] == t[0] || s[1] == t[1] ||
         s[1] == t[2] || s[2] == t[0] || s[2] == t[1] || s[2] == t[2];
}

struct DoubleBox {
  Eigen::Vector3d min, max;
};

inline DoubleBox boxOf(const Triangle& t, const Eigen::Vector3d* positions, double margin) {
  const Eigen::Vector3d &a = positions[t[0]], &b = positions[t[1]], &c = positions[t[2]];
  return {(a.cwiseMin(b).cwiseMin(c).array() - margin).matrix(),
          (a.cwiseMax(b).cwiseMax(c).array() + margin).matrix()};
}

/// At most two float steps below (above) x.
inline float roundDown(double x) {
  const float f = static_cast<float>(x);
  return f - (std::abs(f) * 1.2e-7f + std::numeric_limits<float>::min());
}
inline float roundUp(double x) { return -roundDown(-x); }

}  // namespace palpate::benchmark
