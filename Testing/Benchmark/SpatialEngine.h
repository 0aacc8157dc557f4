#pragma once

#include <palpate/Types.h>

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace palpate::benchmark {

enum class SpatialQuery {
  Closest,         ///< values: distance; elements
  SignedDistance,  ///< values: distance, negative inside
  Contains,        ///< values: 1 inside, 0 outside
  FirstHit,        ///< values: distance from the origin, infinite for none; elements
  AllHits,         ///< elements along the ray, by ascending distance
  EightNearest,    ///< values and elements: eight each, by ascending distance
  Ball,            ///< elements within the radius
  Capsule,         ///< elements that meet the capsule, interior included
  Box              ///< elements that meet the box, interior included
};

/// The arguments of one query. Its kind says which count.
struct SpatialCase {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();         ///< a ray's origin; a shape's centre
  Eigen::Vector3d direction = Eigen::Vector3d::UnitX();    ///< a ray's; a unit vector
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();  ///< a shape's; the capsule is on x
};

/// Sizes of the shapes, the same for all cases of a call.
struct ShapeSizes {
  double ball = 0;                                    ///< L: radius
  double capsuleRadius = 0, capsuleLength = 0;        ///< L: length of its segment
  Eigen::Vector3d boxHalf = Eigen::Vector3d::Zero();  ///< L
};

/// Answers of all cases of a call, one after the other.
struct SpatialAnswers {
  std::vector<double> values;
  std::vector<std::uint32_t> elements;
  std::vector<std::size_t> ends;  ///< of each case's elements; for lists of elements only

  void clear() { values.clear(), elements.clear(), ends.clear(); }
  void add(double value, std::uint32_t element) {
    values.push_back(value), elements.push_back(element);
  }
  void endCase() { ends.push_back(elements.size()); }
};

/// An engine of spatial queries on one deforming geometry: Palpate or a baseline. The geometry is a
/// triangle mesh or a point set, whose triangle i is {i, i, i}.
class SpatialEngine {
 public:
  virtual ~SpatialEngine() = default;
  virtual std::string name() const = 0;
  virtual void prepare(const std::vector<Triangle>&, const std::vector<Eigen::Vector3d>&) = 0;
  /// Builds or refits the engine's structure for positions of the same mesh.
  virtual void update(const std::vector<Eigen::Vector3d>&) = 0;
  virtual bool answers(SpatialQuery) const = 0;
  /// Appends the answers to the cases.
  virtual void ask(SpatialQuery, std::span<const SpatialCase>, const ShapeSizes&,
                   SpatialAnswers&) = 0;
  /// The same by the engine's calls for many cases, where it has some.
  virtual void askTogether(SpatialQuery query, std::span<const SpatialCase> cases,
                           const ShapeSizes& sizes, SpatialAnswers& out) {
    ask(query, cases, sizes, out);
  }
};

std::unique_ptr<SpatialEngine> makePalpateQueries(bool isPointSet);
std::unique_ptr<SpatialEngine> makeEmbreeQueries(bool refit);
std::unique_ptr<SpatialEngine> makeCgalQueries(bool exactPredicates);
std::unique_ptr<SpatialEngine> makeBulletQueries();
std::unique_ptr<SpatialEngine> makeFclQueries();
std::unique_ptr<SpatialEngine> makeVtkQueries(bool isStatic);
std::unique_ptr<SpatialEngine> makeNanoflannQueries();  ///< of point sets only

}  // namespace palpate::benchmark
