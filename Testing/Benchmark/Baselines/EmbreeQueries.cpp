// Embree 3: a triangle geometry in floats. Point queries run a callback of ours for each triangle
// that Embree finds near. Signs come from pseudonormals (Baerentzen, Aanaes 2005); contains()
// counts the hits of a ray in robust mode. Capsules and boxes are asked by their enclosing balls,
// and ours tests the triangles.
#include "SpatialEngine.h"
#include "TriangleGeometry.h"

#include <embree3/rtcore.h>

#include <algorithm>
#include <limits>
#include <map>
#include <stdexcept>
#include <utility>
#include <vector>

namespace palpate::benchmark {
namespace {

using Float3 = Vector<float>;

void throwError(void*, RTCError, const char* what) {
  throw std::runtime_error(std::string("Embree: ") + what);
}

class EmbreeQueries : public SpatialEngine {
 public:
  explicit EmbreeQueries(bool refit) : m_refit(refit) {}
  ~EmbreeQueries() override {
    if (!m_device) return;
    rtcReleaseScene(m_scene);
    rtcReleaseDevice(m_device);
  }

  std::string name() const override {
    return m_refit ? "Embree 3.13, refit, robust rays" : "Embree 3.13, SAH rebuild";
  }

  void prepare(const std::vector<Triangle>& triangles,
               const std::vector<Eigen::Vector3d>& positions) override {
    m_triangles = triangles;
    m_positions.resize(positions.size() + 1);  // Embree reads 16 bytes at each
    m_device = rtcNewDevice("threads=1");
    rtcSetDeviceErrorFunction(m_device, throwError, nullptr);
    m_scene = rtcNewScene(m_device);
    if (m_refit) rtcSetSceneFlags(m_scene, RTC_SCENE_FLAG_DYNAMIC | RTC_SCENE_FLAG_ROBUST);
    if (m_refit) rtcSetSceneBuildQuality(m_scene, RTC_BUILD_QUALITY_LOW);  // or it is rebuilt
    m_geometry = rtcNewGeometry(m_device, RTC_GEOMETRY_TYPE_TRIANGLE);
    rtcSetSharedGeometryBuffer(m_geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                               m_positions.data(), 0, sizeof(Float3), positions.size());
    rtcSetSharedGeometryBuffer(m_geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                               m_triangles.data(), 0, sizeof(Triangle), triangles.size());
    if (m_refit) rtcSetGeometryBuildQuality(m_geometry, RTC_BUILD_QUALITY_REFIT);
    rtcSetGeometryOccludedFilterFunction(m_geometry, collectHit);
    rtcAttachGeometry(m_scene, m_geometry);
    rtcReleaseGeometry(m_geometry);
    findEdges();
    update(positions);
  }

  void update(const std::vector<Eigen::Vector3d>& positions) override {
    for (std::size_t i = 0; i < positions.size(); ++i) m_positions[i] = positions[i].cast<float>();
    rtcUpdateGeometryBuffer(m_geometry, RTC_BUFFER_TYPE_VERTEX, 0);
    rtcCommitGeometry(m_geometry);
    rtcCommitScene(m_scene);
    m_normalsValid = false;
  }

  bool answers(SpatialQuery query) const override {
    return m_refit || query != SpatialQuery::Contains;  // which needs robust rays
  }

  void ask(SpatialQuery query, std::span<const SpatialCase> cases, const ShapeSizes& sizes,
           SpatialAnswers& out) override {
    if (query == SpatialQuery::SignedDistance && !m_normalsValid) findNormals();
    for (const SpatialCase& c : cases) {
      switch (query) {
        case SpatialQuery::Closest:
        case SpatialQuery::SignedDistance:
          closest(c, query == SpatialQuery::SignedDistance, out);
          break;
        case SpatialQuery::Contains:
          out.values.push_back(static_cast<double>(collectHits(c).size() % 2));
          break;
        case SpatialQuery::FirstHit:
          firstHit(c, out);
          break;
        case SpatialQuery::AllHits:
          allHits(c, out);
          break;
        case SpatialQuery::EightNearest:
          eightNearest(c, out);
          break;
        case SpatialQuery::Ball:
          ball(c, sizes, out);
          break;
        case SpatialQuery::Capsule:
          capsule(c, sizes, out);
          break;
        case SpatialQuery::Box:
          box(c, sizes, out);
          break;
      }
    }
  }

  /// Rays in packets of eight, the fastest of Embree's calls for many rays in rows of this kind.
  void askTogether(SpatialQuery query, std::span<const SpatialCase> cases, const ShapeSizes& sizes,
                   SpatialAnswers& out) override {
    if (query != SpatialQuery::FirstHit) return ask(query, cases, sizes, out);
    for (; !cases.empty(); cases = cases.subspan(std::min(cases.size(), kPacket)))
      firstHits(cases.first(std::min(cases.size(), kPacket)), out);
  }

 private:
  static constexpr std::size_t kPacket = 8;

  struct Corners {
    const Float3 &a, &b, &c;
  };
  Corners corners(unsigned triangle) const {
    const Triangle& t = m_triangles[triangle];
    return {m_positions[t[0]], m_positions[t[1]], m_positions[t[2]]};
  }

  /// Calls f(triangle, query) for each triangle within the radius; f returns whether it made the
  /// radius smaller.
  template <class F>
  void query(const Eigen::Vector3d& point, double radius, F&& f) const {
    RTCPointQuery query{static_cast<float>(point[0]), static_cast<float>(point[1]),
                        static_cast<float>(point[2]), 0, static_cast<float>(radius)};
    RTCPointQueryContext context;
    rtcInitPointQueryContext(&context);
    const auto call = [](RTCPointQueryFunctionArguments* arguments) {
      return (*static_cast<std::remove_reference_t<F>*>(arguments->userPtr))(arguments->primID,
                                                                             *arguments->query);
    };
    rtcPointQuery(m_scene, &query, &context, call, &f);
  }

  void closest(const SpatialCase& c, bool isSigned, SpatialAnswers& out) const {
    const Float3 p = c.point.cast<float>();
    ClosestOnTriangle<float> best{{}, std::numeric_limits<float>::infinity(), 0};
    unsigned nearest = 0;
    query(c.point, std::numeric_limits<double>::infinity(),
          [&](unsigned triangle, RTCPointQuery& query) {
            const Corners t = corners(triangle);
            const auto found = closestOnTriangle<float>(p, t.a, t.b, t.c);
            if (found.distanceSquared >= best.distanceSquared) return false;
            best = found;
            nearest = triangle;
            query.radius = std::sqrt(found.distanceSquared);
            return true;
          });
    float distance = std::sqrt(best.distanceSquared);
    if (isSigned && isBehind(p, nearest, best)) distance = -distance;
    out.add(distance, nearest);
  }

  bool isBehind(const Float3& p, unsigned triangle, const ClosestOnTriangle<float>& at) const {
    const Corners t = corners(triangle);
    const Float3 offset = p - at.weights[0] * t.a - at.weights[1] * t.b - at.weights[2] * t.c;
    const auto vertex = [&](std::size_t i) { return m_vertexNormals[m_triangles[triangle][i]]; };
    const auto edge = [&](std::size_t i) { return m_edgeNormals[m_edges[triangle][i]]; };
    switch (at.feature) {
      case 1:
        return offset.dot(vertex(0)) < 0;
      case 2:
        return offset.dot(vertex(1)) < 0;
      case 4:
        return offset.dot(vertex(2)) < 0;
      case 3:
        return offset.dot(edge(0)) < 0;
      case 6:
        return offset.dot(edge(1)) < 0;
      case 5:
        return offset.dot(edge(2)) < 0;
      default:
        return offset.dot((t.b - t.a).cross(t.c - t.a)) < 0;
    }
  }

  RTCRay ray(const SpatialCase& c) const {
    const Float3 o = c.point.cast<float>(), d = c.direction.cast<float>();
    return {o[0], o[1], o[2], 0, d[0], d[1], d[2], 0, std::numeric_limits<float>::infinity(),
            ~0u,  0,    0};
  }

  void firstHit(const SpatialCase& c, SpatialAnswers& out) const {
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    RTCRayHit hit{ray(c), {}};
    hit.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    rtcIntersect1(m_scene, &context, &hit);
    const bool found = hit.hit.geomID != RTC_INVALID_GEOMETRY_ID;
    out.add(found ? hit.ray.tfar : std::numeric_limits<double>::infinity(),
            found ? hit.hit.primID : ~0u);
  }

  /// At most kPacket rays.
  void firstHits(std::span<const SpatialCase> cases, SpatialAnswers& out) const {
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    alignas(32) int valid[kPacket] = {};
    RTCRayHit8 hits{};
    for (std::size_t i = 0; i < cases.size(); ++i) {
      const RTCRay one = ray(cases[i]);
      valid[i] = -1;
      hits.ray.org_x[i] = one.org_x, hits.ray.org_y[i] = one.org_y, hits.ray.org_z[i] = one.org_z;
      hits.ray.dir_x[i] = one.dir_x, hits.ray.dir_y[i] = one.dir_y, hits.ray.dir_z[i] = one.dir_z;
      hits.ray.tfar[i] = one.tfar, hits.ray.mask[i] = one.mask;
      hits.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
    }
    rtcIntersect8(valid, m_scene, &context, &hits);
    for (std::size_t i = 0; i < cases.size(); ++i) {
      const bool found = hits.hit.geomID[i] != RTC_INVALID_GEOMETRY_ID;
      out.add(found ? hits.ray.tfar[i] : std::numeric_limits<double>::infinity(),
              found ? hits.hit.primID[i] : ~0u);
    }
  }

  using Hits = std::vector<std::pair<float, unsigned>>;
  struct CollectingContext {
    RTCIntersectContext context;
    Hits* hits;
  };
  /// Collects a hit and rejects it.
  static void collectHit(const RTCFilterFunctionNArguments* arguments) {
    reinterpret_cast<CollectingContext*>(arguments->context)
        ->hits->push_back(
            {RTCRayN_tfar(arguments->ray, 1, 0), RTCHitN_primID(arguments->hit, 1, 0)});
    arguments->valid[0] = 0;
  }

  const Hits& collectHits(const SpatialCase& c) {
    CollectingContext context{{}, &m_hits};
    m_hits.clear();
    rtcInitIntersectContext(&context.context);
    RTCRay along = ray(c);
    rtcOccluded1(m_scene, &context.context, &along);
    return m_hits;
  }
  void allHits(const SpatialCase& c, SpatialAnswers& out) {
    collectHits(c);
    std::sort(m_hits.begin(), m_hits.end());
    for (const auto& [t, triangle] : m_hits) out.elements.push_back(triangle);
    out.endCase();
  }

  void eightNearest(const SpatialCase& c, SpatialAnswers& out) const {
    const Float3 p = c.point.cast<float>();
    std::array<std::pair<float, unsigned>, 8> best;
    std::size_t count = 0;
    query(c.point, std::numeric_limits<double>::infinity(),
          [&](unsigned triangle, RTCPointQuery& query) {
            const Corners t = corners(triangle);
            const float d = closestOnTriangle<float>(p, t.a, t.b, t.c).distanceSquared;
            if (count == best.size() && d >= best[count - 1].first) return false;
            std::size_t at = count < best.size() ? count++ : count - 1;
            for (; at > 0 && best[at - 1].first > d; --at) best[at] = best[at - 1];
            best[at] = {d, triangle};
            if (count < best.size()) return false;
            query.radius = std::sqrt(best[count - 1].first);
            return true;
          });
    for (std::size_t i = 0; i < count; ++i) out.add(std::sqrt(best[i].first), best[i].second);
  }

  void ball(const SpatialCase& c, const ShapeSizes& sizes, SpatialAnswers& out) const {
    const Float3 p = c.point.cast<float>();
    const auto radius = static_cast<float>(sizes.ball);
    query(c.point, radius, [&](unsigned triangle, RTCPointQuery&) {
      const Corners t = corners(triangle);
      if (closestOnTriangle<float>(p, t.a, t.b, t.c).distanceSquared <= radius * radius)
        out.elements.push_back(triangle);
      return false;
    });
    out.endCase();
  }

  void capsule(const SpatialCase& c, const ShapeSizes& sizes, SpatialAnswers& out) const {
    const Float3 p = c.point.cast<float>(),
                 half = (c.rotation.col(0) * sizes.capsuleLength / 2).cast<float>();
    const Float3 p0 = p - half, p1 = p + half;
    const auto radius = static_cast<float>(sizes.capsuleRadius);
    query(c.point, sizes.capsuleLength / 2 + sizes.capsuleRadius,
          [&](unsigned triangle, RTCPointQuery&) {
            const Corners t = corners(triangle);
            if (segmentTriangleDistanceSquared<float>(p0, p1, t.a, t.b, t.c) <= radius * radius)
              out.elements.push_back(triangle);
            return false;
          });
    out.endCase();
  }

  void box(const SpatialCase& c, const ShapeSizes& sizes, SpatialAnswers& out) const {
    const Float3 p = c.point.cast<float>(), half = sizes.boxHalf.cast<float>();
    const Eigen::Matrix3f toBox = c.rotation.transpose().cast<float>();
    query(c.point, sizes.boxHalf.norm(), [&](unsigned triangle, RTCPointQuery&) {
      const Corners t = corners(triangle);
      if (boxGap<float>(half, toBox * (t.a - p), toBox * (t.b - p), toBox * (t.c - p), 0) <= 0)
        out.elements.push_back(triangle);
      return false;
    });
    out.endCase();
  }

  void findEdges() {
    std::map<std::array<std::uint32_t, 2>, std::uint32_t> ids;
    m_edges.resize(m_triangles.size());
    for (std::size_t t = 0; t < m_triangles.size(); ++t)
      for (std::size_t i = 0; i < 3; ++i) {
        const auto [low, high] = std::minmax(m_triangles[t][i], m_triangles[t][(i + 1) % 3]);
        m_edges[t][i] =
            ids.try_emplace({low, high}, static_cast<std::uint32_t>(ids.size())).first->second;
      }
    m_edgeNormals.resize(ids.size());
    m_vertexNormals.resize(m_positions.size());
  }

  void findNormals() {
    std::fill(m_edgeNormals.begin(), m_edgeNormals.end(), Float3::Zero());
    std::fill(m_vertexNormals.begin(), m_vertexNormals.end(), Float3::Zero());
    for (unsigned triangle = 0; triangle < m_triangles.size(); ++triangle) {
      const Corners t = corners(triangle);
      const Float3 normal = (t.b - t.a).cross(t.c - t.a).normalized();
      const Float3* p[] = {&t.a, &t.b, &t.c};
      for (std::size_t i = 0; i < 3; ++i) {
        m_edgeNormals[m_edges[triangle][i]] += normal;
        const Float3 u = *p[(i + 1) % 3] - *p[i], v = *p[(i + 2) % 3] - *p[i];
        m_vertexNormals[m_triangles[triangle][i]] +=
            std::atan2(u.cross(v).norm(), u.dot(v)) * normal;
      }
    }
    m_normalsValid = true;
  }

  bool m_refit, m_normalsValid = false;
  RTCDevice m_device = nullptr;
  RTCScene m_scene = nullptr;
  RTCGeometry m_geometry = nullptr;
  Hits m_hits;
  std::vector<Triangle> m_triangles, m_edges;
  std::vector<Float3> m_positions, m_vertexNormals, m_edgeNormals;
};

}  // namespace

std::unique_ptr<SpatialEngine> makeEmbreeQueries(bool refit) {
  return std::make_unique<EmbreeQueries>(refit);
}

}  // namespace palpate::benchmark
