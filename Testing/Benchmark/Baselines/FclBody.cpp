// FCL 0.7: BVHModel<OBBRSS<double>>, one refitted, one placed by a transform, through collide(),
// which gives one contact for each pair of triangles that intersect.
#include "Baselines/FclBody.h"

#include "Measure.h"

#include <fcl/geometry/bvh/BVH_model.h>
#include <fcl/narrowphase/collision.h>

#include <limits>

namespace palpate::benchmark {

using Model = fcl::BVHModel<fcl::OBBRSS<double>>;

struct FclBody::Models {
  Model organ, body;
  std::vector<Eigen::Vector3d> positions;
};

static void fill(Model& model, std::span<const Eigen::Vector3d> positions,
                 std::span<const Triangle> triangles) {
  std::vector<fcl::Triangle> indices;
  for (const Triangle& t : triangles) indices.emplace_back(t[0], t[1], t[2]);
  model.beginModel(static_cast<int>(triangles.size()), static_cast<int>(positions.size()));
  model.addSubModel({positions.begin(), positions.end()}, indices);
  model.endModel();
}

FclBody::FclBody(std::span<const Eigen::Vector3d> organ, std::span<const Triangle> organTriangles,
                 std::span<const Eigen::Vector3d> body, std::span<const Triangle> bodyTriangles)
    : m_models(std::make_unique<Models>()) {
  fill(m_models->organ, organ, organTriangles);
  fill(m_models->body, body, bodyTriangles);
}
FclBody::~FclBody() = default;

FclBody::Answer FclBody::collide(std::span<const Eigen::Vector3d> organ,
                                 const Eigen::Matrix3d& rotation,
                                 const Eigen::Vector3d& translation) {
  m_models->positions.assign(organ.begin(), organ.end());
  fcl::Transform3d place = fcl::Transform3d::Identity();
  place.linear() = rotation;
  place.translation() = translation;
  fcl::CollisionRequest<double> request(std::numeric_limits<int>::max(), true);
  fcl::CollisionResult<double> result;
  const double start = now();
  m_models->organ.beginReplaceModel();
  m_models->organ.replaceSubModel(m_models->positions);
  m_models->organ.endReplaceModel(true, true);
  const std::size_t contacts = fcl::collide(&m_models->organ, fcl::Transform3d::Identity(),
                                            &m_models->body, place, request, result);
  return {now() - start, contacts};
}

}  // namespace palpate::benchmark
