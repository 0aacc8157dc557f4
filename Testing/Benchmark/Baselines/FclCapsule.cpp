// FCL 0.7: BVHModel<OBBRSS<double>>, refitted, against a capsule through collide(), which gives one
// contact for each triangle that overlaps it.
#include "Baselines/FclCapsule.h"

#include "Measure.h"

#include <fcl/geometry/bvh/BVH_model.h>
#include <fcl/geometry/shape/capsule.h>
#include <fcl/narrowphase/collision.h>

#include <limits>

namespace palpate::benchmark {

struct FclCapsule::Model {
  std::shared_ptr<fcl::BVHModel<fcl::OBBRSS<double>>> mesh =
      std::make_shared<fcl::BVHModel<fcl::OBBRSS<double>>>();
  std::vector<Eigen::Vector3d> positions;
};

FclCapsule::FclCapsule(std::span<const Eigen::Vector3d> positions,
                       std::span<const Triangle> triangles)
    : m_model(std::make_unique<Model>()) {
  std::vector<fcl::Triangle> indices;
  for (const Triangle& t : triangles) indices.emplace_back(t[0], t[1], t[2]);
  m_model->mesh->beginModel(static_cast<int>(triangles.size()), static_cast<int>(positions.size()));
  m_model->mesh->addSubModel({positions.begin(), positions.end()}, indices);
  m_model->mesh->endModel();
}
FclCapsule::~FclCapsule() = default;

FclCapsule::Answer FclCapsule::collide(std::span<const Eigen::Vector3d> positions,
                                       const Eigen::Vector3d& p0, const Eigen::Vector3d& p1,
                                       double radius) {
  m_model->positions.assign(positions.begin(), positions.end());
  m_model->mesh->beginReplaceModel();
  m_model->mesh->replaceSubModel(m_model->positions);
  m_model->mesh->endReplaceModel(true, true);
  const fcl::Capsule<double> capsule(radius, (p1 - p0).norm());
  fcl::Transform3d place = fcl::Transform3d::Identity();
  place.linear() =
      Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), p1 - p0).toRotationMatrix();
  place.translation() = 0.5 * (p0 + p1);
  fcl::CollisionRequest<double> request(std::numeric_limits<int>::max(), true);
  fcl::CollisionResult<double> result;
  const double start = now();
  const std::size_t contacts = fcl::collide(m_model->mesh.get(), fcl::Transform3d::Identity(),
                                            &capsule, place, request, result);
  return {now() - start, contacts};
}

}  // namespace palpate::benchmark
