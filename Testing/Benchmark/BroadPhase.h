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

/// The input of every engine before the clock starts: triangles, and pairs of meshes.
struct Task {
  std::vector<std::vector<Triangle>> meshes;
  std::vector<std::array<std::size_t, 2>>
      pairs;             ///< mesh against mesh; a mesh against itself: self-collision
  double thickness = 0;  ///< L; every box grows by half of it on each side
  int threads = 1;
};

/// One position array per mesh of the task.
using Positions = std::vector<std::vector<Eigen::Vector3d>>;

/// An engine that finds all pairs of triangles whose boxes overlap, in memory and in the order
/// found: Palpate or a baseline. In self-collision it finds each unordered pair once, with a < b
/// and without pairs that share a vertex.
class BroadPhase {
 public:
  virtual ~BroadPhase() = default;
  virtual std::string name() const = 0;
  virtual bool rebuilds() const = 0;  ///< builds its trees anew in every frame
  virtual void prepare(const Task&, const Positions&) = 0;
  /// A frame: update() makes boxes and trees, collide() finds pairs. The clock runs over both.
  virtual void update(const Positions&) = 0;
  virtual void collide() = 0;
  /// The last frame's pairs, sorted. This is not timed.
  virtual std::vector<ElementPair> candidates(std::size_t pair) const = 0;
};

std::unique_ptr<BroadPhase> makeEmbreeRefit();
std::unique_ptr<BroadPhase> makeEmbreeMorton();
std::unique_ptr<BroadPhase> makeBullet();
std::unique_ptr<BroadPhase> makeFcl();
std::unique_ptr<BroadPhase> makeCgal();

/// The points inside a closed body, with the nearest points of its surface.
struct InsideAnswer {
  double milliseconds = 0;  ///< without building the trees
  std::size_t inside = 0;   ///< number of points
  double depth = 0;         ///< sum of their depths
};
InsideAnswer insideByCgal(const std::vector<Eigen::Vector3d>& positions,
                          const std::vector<Triangle>& triangles,
                          const std::vector<Eigen::Vector3d>& points);

/// One list of pairs for each mesh pair and thread, so that threads share none. It keeps its
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
