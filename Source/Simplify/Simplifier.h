#pragma once

#include <palpate/Simplify.h>

#include "Simplify/SimplifyBy.h"
#include "Simplify/SimplifyCertificate.h"
#include "Simplify/SimplifyOffset.h"
#include "Bodies/Body.h"
#include "Core/Threads.h"

#include <Eigen/Core>

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace palpate {

/// Simplifies a closed mesh in rounds. In each round the mesh is simplified, the result is moved
/// outward, and each of its triangles is tested. Where a test fails, the mesh has a finer level in
/// the next round.
class Simplifier {
 public:
  /// largest: L, of the mesh's coordinates. The body's octree must be up to date.
  Simplifier(CollapseEdges, const Body& body, const SimplifySettings&, double largest,
             const Threads&);
  SimplifiedMesh run();

 private:
  /// Which components of a mesh its vertices belong to.
  using Components = std::vector<std::uint32_t>;
  static Components componentsOf(std::size_t vertices, std::span<const Triangle>);

  // ---- Once ----
  void findSides();

  // ---- In each round ----
  void collapse();
  void restart();
  void collapseLevel(std::uint8_t level);
  void markOpenEdges();
  void markLostComponents();
  void numberVertices();
  void measureProtrusions();
  void moveOutward();
  void moveVertex(std::uint32_t vertex);
  void liftTouching();
  void boundDistances();
  void checkComponents();
  std::size_t refineFailed();
  [[noreturn]] void giveUp() const;
  std::optional<ElementPair> findCrossing() const;

  Corners cornersOf(const Triangle&) const;
  double errorOf(std::uint8_t level) const;   ///< L: for CollapseEdges
  double offsetOf(std::uint8_t level) const;  ///< L: the least offset of planes
  /// Calls f(index, stack) for [0, size), on all threads, and reports the progress.
  template <class F>
  void forEach(std::size_t size, F&& f);
  void report(double share);

  const CollapseEdges m_collapse;
  const Body& m_body;
  const SimplifySettings& m_settings;
  const Threads& m_threads;
  const SimplifyCertificate m_certificate;
  std::span<const Triangle> m_input;
  Components m_components;           ///< of the mesh
  std::vector<std::int8_t> m_sides;  ///< per component's lowest vertex: as for outwardWays(), or 0
                                     ///< for a shell inside the mesh
  std::vector<Eigen::Vector3d> m_normals;  ///< of the mesh's vertices, of any length
  std::vector<std::uint8_t> m_levels;      ///< of the mesh's triangles
  std::vector<std::uint8_t> m_isBad;       ///< per component's lowest vertex: all of it failed
  int m_round = 0, m_restarts = 0;
  std::size_t m_firstCount = 0;  ///< of triangles, before any part had a finer level
  struct Failure {
    Eigen::Vector3d place = Eigen::Vector3d::Zero();  ///< L
    std::optional<std::uint32_t> stuck{};             ///< a vertex of the mesh without a way
  } m_failure;                                        ///< one of the last round
  double m_reported = 0.0;

  // The result of this round. Vertices are numbered anew, ascending by those of the mesh.
  std::vector<Triangle> m_triangles;
  std::vector<std::uint8_t> m_levelOf;  ///< per triangle
  std::vector<std::uint8_t> m_failed;   ///< per triangle
  std::vector<std::uint32_t> m_origin;  ///< per vertex: that of the mesh
  std::vector<Eigen::Vector3d> m_start, m_moved;
  std::vector<std::int8_t> m_sideOf;  ///< per triangle
  std::vector<OutwardWay> m_ways;
  std::vector<double> m_offsets;       ///< L, per vertex
  std::vector<double> m_protrusions;   ///< L, per triangle
  std::vector<std::uint32_t> m_owner;  ///< per vertex of the mesh: the triangle nearest to it
  std::vector<double> m_bounds;        ///< L, per triangle
};

}  // namespace palpate
