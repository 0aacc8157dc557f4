// FCL 0.7: BVHModel<OBBRSS<double>>, its boxes fitted anew from the top for each frame. (Refitted
// bottom-up it updates faster, but distance() takes hundreds of times as long.) collide() with a
// shape lists the triangles that meet it; distance() is that of two meshes.
#include "Baselines/FclDistance.h"
#include "SpatialEngine.h"

#include <fcl/geometry/bvh/BVH_model.h>
#include <fcl/geometry/shape/box.h>
#include <fcl/geometry/shape/capsule.h>
#include <fcl/geometry/shape/sphere.h>
#include <fcl/narrowphase/collision.h>
#include <fcl/narrowphase/distance.h>

#include <limits>

namespace palpate::benchmark {
namespace {

using Model = fcl::BVHModel<fcl::OBBRSS<double>>;

void fill(Model& model, std::span<const Triangle> triangles,
          std::span<const Eigen::Vector3d> positions) {
  std::vector<fcl::Triangle> indices;
  for (const Triangle& t : triangles) indices.emplace_back(t[0], t[1], t[2]);
  model.beginModel(static_cast<int>(triangles.size()), static_cast<int>(positions.size()));
  model.addSubModel({positions.begin(), positions.end()}, indices);
  model.endModel();
}

void refit(Model& model, const std::vector<Eigen::Vector3d>& positions) {
  model.beginReplaceModel();
  model.replaceSubModel(positions);
  model.endReplaceModel(true, false);
}

class FclQueries : public SpatialEngine {
 public:
  std::string name() const override { return "FCL 0.7 BVHModel<OBBRSS>, refit"; }

  void prepare(const std::vector<Triangle>& triangles,
               const std::vector<Eigen::Vector3d>& positions) override {
    fill(m_model, triangles, positions);
  }
  void update(const std::vector<Eigen::Vector3d>& positions) override { refit(m_model, positions); }

  bool answers(SpatialQuery query) const override {
    return query == SpatialQuery::Ball || query == SpatialQuery::Capsule ||
           query == SpatialQuery::Box;
  }

  void ask(SpatialQuery query, std::span<const SpatialCase> cases, const ShapeSizes& sizes,
           SpatialAnswers& out) override {
    const fcl::Sphere<double> ball(sizes.ball);
    const fcl::Capsule<double> capsule(sizes.capsuleRadius, sizes.capsuleLength);  // along z
    const fcl::Box<double> box(2 * sizes.boxHalf);
    const fcl::CollisionRequest<double> request(std::numeric_limits<int>::max());
    for (const SpatialCase& c : cases) {
      fcl::Transform3d place = fcl::Transform3d::Identity();
      place.linear() = c.rotation;
      place.translation() = c.point;
      const fcl::CollisionGeometry<double>* shape = &box;
      if (query == SpatialQuery::Ball) shape = &ball;
      if (query == SpatialQuery::Capsule) {
        shape = &capsule;
        place.linear().col(2) = c.rotation.col(0);
        place.linear().col(0) = c.rotation.col(1);
        place.linear().col(1) = c.rotation.col(2);
      }
      fcl::CollisionResult<double> result;
      fcl::collide(&m_model, fcl::Transform3d::Identity(), shape, place, request, result);
      for (std::size_t i = 0; i < result.numContacts(); ++i)
        out.elements.push_back(static_cast<std::uint32_t>(result.getContact(i).b1));
      out.endCase();
    }
  }

 private:
  Model m_model;
};

}  // namespace

struct FclDistance::Models {
  Model a, b;
};

FclDistance::FclDistance(std::span<const Triangle> triangles, std::span<const Eigen::Vector3d> a,
                         std::span<const Eigen::Vector3d> b)
    : m_models(std::make_unique<Models>()) {
  fill(m_models->a, triangles, a);
  fill(m_models->b, triangles, b);
}
FclDistance::~FclDistance() = default;

void FclDistance::update(const std::vector<Eigen::Vector3d>& a,
                         const std::vector<Eigen::Vector3d>& b) {
  refit(m_models->a, a);
  refit(m_models->b, b);
}

double FclDistance::distance(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b) const {
  const fcl::DistanceRequest<double> request(true);
  fcl::DistanceResult<double> result;
  return fcl::distance(&m_models->a, a, &m_models->b, b, request, result);
}

std::unique_ptr<SpatialEngine> makeFclQueries() { return std::make_unique<FclQueries>(); }

}  // namespace palpate::benchmark
