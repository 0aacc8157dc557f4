#pragma once

#include "C/Border.h"

#include <palpate/AnalyticalGeometry.h>
#include <palpate/DistanceField.h>
#include <palpate/OctreeBasedCD.h>
#include <palpate/Snapshot.h>
#include <palpate/SpatialQueries.h>
#include <palpate/ThreadTopology.h>

#include <memory>

struct palpate_cd {
  palpate::OctreeBasedCD cd;
};
struct palpate_queries {
  palpate::SpatialQueries queries;
};
struct palpate_snapshot {
  std::shared_ptr<const palpate::Snapshot> snapshot;
};
struct palpate_field {
  std::shared_ptr<const palpate::DistanceField> field;
};
struct palpate_topology {
  palpate::ThreadTopology topology;
};

namespace palpate::c {

inline OctreeBasedCD& of(palpate_cd* cd) { return given(cd, "cd").cd; }
inline const OctreeBasedCD& of(const palpate_cd* cd) { return given(cd, "cd").cd; }
inline const SpatialQueries& of(const palpate_queries* queries) {
  return given(queries, "queries").queries;
}
inline ThreadTopology& of(palpate_topology* topology) {
  return given(topology, "topology").topology;
}
inline const ThreadTopology& of(const palpate_topology* topology) {
  return given(topology, "topology").topology;
}
inline const Snapshot& of(const palpate_snapshot* snapshot) {
  return *given(snapshot, "snapshot").snapshot;
}

Pose poseOf(const palpate_pose* pose, const char* name);
palpate_pose fromPose(const Pose& pose);
RigidMotion motionOf(const palpate_motion* motion, const char* name);
palpate_motion fromMotion(const RigidMotion& motion);
AnalyticalGeometry shapeOf(const palpate_shape* shape);

inline void fromVector(const Eigen::Vector3d& vector, double* out) {
  for (int i = 0; i < 3; ++i) out[i] = vector[i];
}

}  // namespace palpate::c
