// Embree 3: one user geometry in one scene for each mesh, bounds from a callback, rtcCollide
// between scenes. A scene of several geometries would also report every geometry against itself.
// Leaves of the tree that is refitted hold several primitives, all of which rtcCollide reports:
// "the user is expected to [...] filter out false positives in the callback", here by the boxes
// that the bounds callback kept.
#include "BroadPhase.h"

#include <embree3/rtcore.h>

#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <stdexcept>

namespace palpate::benchmark {
namespace {

void throwError(void*, RTCError, const char* what) {
  throw std::runtime_error(std::string("Embree: ") + what);
}

struct Mesh {
  RTCScene scene = nullptr;
  RTCGeometry geometry = nullptr;
  const std::vector<Triangle>* triangles = nullptr;
  const Eigen::Vector3d* positions = nullptr;
  double margin = 0;
  std::vector<RTCBounds> boxes;

  bool overlaps(unsigned primitive, const Mesh& other, unsigned otherPrimitive) const {
    const RTCBounds &a = boxes[primitive], &b = other.boxes[otherPrimitive];
    return (a.lower_x <= b.upper_x) & (a.lower_y <= b.upper_y) & (a.lower_z <= b.upper_z) &
           (b.lower_x <= a.upper_x) & (b.lower_y <= a.upper_y) & (b.lower_z <= a.upper_z);
  }
};

void bounds(const RTCBoundsFunctionArguments* arguments) {
  Mesh& mesh = *static_cast<Mesh*>(arguments->geometryUserPtr);
  const DoubleBox box = boxOf((*mesh.triangles)[arguments->primID], mesh.positions, mesh.margin);
  RTCBounds& out = *arguments->bounds_o;
  out.lower_x = roundDown(box.min.x());
  out.lower_y = roundDown(box.min.y());
  out.lower_z = roundDown(box.min.z());
  out.upper_x = roundUp(box.max.x());
  out.upper_y = roundUp(box.max.y());
  out.upper_z = roundUp(box.max.z());
  mesh.boxes[arguments->primID] = out;
}

struct Target {
  PairLists* lists;
  std::size_t pair;
  const Mesh &a, &b;
  std::vector<ElementPair>& list() const {
    return lists->of(pair, static_cast<std::size_t>(tbb::this_task_arena::current_thread_index()));
  }
};

void collectBetween(void* user, RTCCollision* collisions, unsigned count) {
  const Target& target = *static_cast<const Target*>(user);
  auto& list = target.list();
  for (unsigned i = 0; i < count; ++i) {
    const unsigned a = collisions[i].primID0, b = collisions[i].primID1;
    if (target.a.overlaps(a, target.b, b)) list.push_back({a, b});
  }
}

// A scene against itself delivers (a, b) and (b, a).
void collectWithin(void* user, RTCCollision* collisions, unsigned count) {
  const Target& target = *static_cast<const Target*>(user);
  auto& list = target.list();
  const std::vector<Triangle>& triangles = *target.a.triangles;
  for (unsigned i = 0; i < count; ++i) {
    const unsigned a = collisions[i].primID0, b = collisions[i].primID1;
    if (a < b && target.a.overlaps(a, target.a, b) && !shareVertex(triangles[a], triangles[b]))
      list.push_back({a, b});
  }
}

class Embree : public BroadPhase {
 public:
  explicit Embree(RTCBuildQuality quality) : m_quality(quality) {}
  ~Embree() override { release(); }

  std::string name() const override {
    return rebuilds() ? "Embree 3.13, Morton rebuild + rtcCollide"
                      : "Embree 3.13, refit + rtcCollide";
  }
  bool rebuilds() const override { return m_quality == RTC_BUILD_QUALITY_LOW; }

  void prepare(const Task& task, const Positions& positions) override {
    release();
    m_task = task;
    m_arena.initialize(task.threads);
    m_device = rtcNewDevice(nullptr);
    rtcSetDeviceErrorFunction(m_device, throwError, nullptr);
    m_lists.prepare(task.pairs.size(), task.threads);
    m_meshes.resize(task.meshes.size());
    for (std::size_t i = 0; i < m_meshes.size(); ++i)
      addMesh(m_meshes[i], m_task.meshes[i], positions[i].data());
    update(positions);
  }

  void update(const Positions& positions) override {
    m_arena.execute([&] {
      tbb::parallel_for(std::size_t(0), m_meshes.size(), [&](std::size_t i) {
        Mesh& mesh = m_meshes[i];
        mesh.positions = positions[i].data();
        rtcCommitGeometry(mesh.geometry);
        rtcCommitScene(mesh.scene);
      });
    });
  }

  void collide() override {
    m_lists.clear();
    m_arena.execute([&] {
      tbb::parallel_for(std::size_t(0), m_task.pairs.size(), [&](std::size_t pair) {
        const auto [a, b] = m_task.pairs[pair];
        Target target{&m_lists, pair, m_meshes[a], m_meshes[b]};
        rtcCollide(m_meshes[a].scene, m_meshes[b].scene, a == b ? collectWithin : collectBetween,
                   &target);
      });
    });
  }

  std::vector<ElementPair> candidates(std::size_t pair) const override {
    return m_lists.sorted(pair);
  }

 private:
  void addMesh(Mesh& mesh, const std::vector<Triangle>& triangles,
               const Eigen::Vector3d* positions) {
    mesh = {rtcNewScene(m_device),
            rtcNewGeometry(m_device, RTC_GEOMETRY_TYPE_USER),
            &triangles,
            positions,
            m_task.thickness / 2,
            std::vector<RTCBounds>(triangles.size())};
    rtcSetGeometryUserPrimitiveCount(mesh.geometry, static_cast<unsigned>(triangles.size()));
    rtcSetGeometryUserData(mesh.geometry, &mesh);
    rtcSetGeometryBoundsFunction(mesh.geometry, bounds, nullptr);
    rtcSetGeometryBuildQuality(mesh.geometry, m_quality);
    rtcCommitGeometry(mesh.geometry);
    rtcAttachGeometry(mesh.scene, mesh.geometry);
    rtcSetSceneFlags(mesh.scene, RTC_SCENE_FLAG_DYNAMIC);
    rtcSetSceneBuildQuality(mesh.scene, RTC_BUILD_QUALITY_LOW);
  }

  void release() {
    for (Mesh& mesh : m_meshes) {
      rtcReleaseGeometry(mesh.geometry);
      rtcReleaseScene(mesh.scene);
    }
    m_meshes.clear();
    if (m_device) rtcReleaseDevice(m_device);
    m_device = nullptr;
    m_arena.terminate();
  }

  RTCBuildQuality m_quality;
  RTCDevice m_device = nullptr;
  Task m_task;
  std::vector<Mesh> m_meshes;
  PairLists m_lists;
  tbb::task_arena m_arena;
};

}  // namespace

std::unique_ptr<BroadPhase> makeEmbreeRefit() {
  return std::make_unique<Embree>(RTC_BUILD_QUALITY_REFIT);
}
std::unique_ptr<BroadPhase> makeEmbreeMorton() {
  return std::make_unique<Embree>(RTC_BUILD_QUALITY_LOW);
}

}  // namespace palpate::benchmark
