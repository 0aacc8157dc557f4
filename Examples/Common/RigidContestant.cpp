#include "RigidContestant.h"

#include <palpate/Meshes.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <numbers>

namespace palpate::accuracy {

using Eigen::Vector3d;

namespace {

double millisecondsSince(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start)
      .count();
}

}  // namespace

RigidRun::RigidRun(const RigidScene& scene, const RigidContestant& contestant)
    : m_method(contestant.method),
      m_thickness(scene.thickness),
      m_isClosed(findMeshDefects(scene.body.triangles).closed()) {
  const auto start = std::chrono::steady_clock::now();
  const scenes::SceneMesh &body = scene.body, &tool = scene.tool;
  m_tool = tool.triangles.empty() ? m_detection.addPointSet(tool.positions)
                                  : m_detection.addTriangleMesh(tool.positions, tool.triangles);
  if (m_method == Method::DistanceField) {
    m_field = std::make_shared<const DistanceField>(
        DistanceField::build({body.positions, body.triangles},
                             {.errorBound = contestant.error,
                              .band = std::max(scene.band, scene.thickness + 2 * contestant.error),
                              .threads = 1}));
    m_body = m_detection.addDistanceField(m_field);
  } else {
    m_body = m_detection.addTriangleMesh(body.positions, body.triangles);
  }
  PairSettings settings{.method = m_method, .thickness = scene.thickness};
  if (m_method == Method::Proxy)
    settings.allowedError = contestant.error;
  else
    settings.contacts = Contacts::All;
  m_detection.addCollisionPair(m_tool, m_body, settings);
  m_detection.detectCollision();
  m_buildMilliseconds = millisecondsSince(start);
}

double RigidRun::step(std::span<const Vector3d> now) {
  m_detection.advance();
  const auto start = std::chrono::steady_clock::now();
  m_detection.setPositions(m_tool, now);
  m_detection.detectCollision();
  return millisecondsSince(start);
}

double RigidRun::depth() const {
  if (m_method == Method::Proximity) return m_thickness;
  return m_method == Method::Proxy ? data().validity().proxyDepth : kInfinity;
}

std::vector<VertexClaim> RigidRun::claims() const {
  std::vector<VertexClaim> claims;
  const CollisionData& answer = data();
  for (const VertexTriangleContact& contact : answer.vertexTriangle())
    claims.push_back({contact.vertex, contact.normal, contact.distance, false});
  const std::vector<std::uint32_t>&beyond = answer.validity().outsideBand,
        &unsure = answer.validity().unreliableSign;
  std::uint32_t index = 0;
  for (const ShapeContact& contact : answer.shape()) {
    if (contact.element == ShapeElement::Vertex)
      claims.push_back({contact.id, contact.normal, contact.distance,
                        std::binary_search(beyond.begin(), beyond.end(), index) ||
                            std::binary_search(unsure.begin(), unsure.end(), index)});
    ++index;
  }
  std::sort(claims.begin(), claims.end(), [](const VertexClaim& a, const VertexClaim& b) {
    return a.vertex != b.vertex ? a.vertex < b.vertex : a.distance < b.distance;
  });
  claims.erase(std::unique(claims.begin(), claims.end(),
                           [](const auto& a, const auto& b) { return a.vertex == b.vertex; }),
               claims.end());
  return claims;
}

void RigidScore::add(const RigidScene& scene, const RigidRun& run, std::span<const Vector3d> now,
                     std::span<const SignedDistance> truth) {
  const bool hasSign = run.method() != Method::Proximity;
  const double rounding = 1e-12 * (scene.thickness + scene.band), stated = run.errorBound(),
               bound = stated + rounding;
  // Proximity's answers have no error bound, but they are trusted or not.
  const auto isSilent = [&](bool isDoubtful) {
    return !isDoubtful && (hasSign || run.isTrusted());
  };
  statedWorst = std::max(statedWorst, stated);
  const std::vector<VertexClaim> reported = run.claims();
  claims += reported.size();
  auto claim = reported.begin();
  for (std::uint32_t v = 0; v < now.size(); ++v) {
    const double distance = run.knowsSide(now[v]) ? truth[v].distance : std::abs(truth[v].distance);
    within += distance <= scene.thickness;
    if (claim == reported.end() || claim->vertex != v) {
      if (distance > scene.thickness - bound) continue;
      ++missing;
      silent += isSilent(-distance > run.depth() - bound);
      continue;
    }
    extra += distance > scene.thickness + bound;
    doubtful += claim->isDoubtful;
    const double error = std::abs(claim->distance - (hasSign ? distance : std::abs(distance)));
    distanceWorst = std::max(distanceWorst, error);
    distanceSquares += error * error;
    if (error > bound) {
      ++beyondStated;
      silent += isSilent(claim->isDoubtful);
    }
    if (std::abs(distance) > 1e-9 * scene.thickness) {
      const Vector3d outwards = (now[v] - truth[v].nearest.position) / distance;
      const double cosine = std::clamp(outwards.dot(claim->normal), -1.0, 1.0);
      wrongSide += cosine < 0;
      normalWorst = std::max(normalWorst, std::acos(cosine) * 180 / std::numbers::pi);
    }
    ++claim;
  }
}

double RigidScore::distanceRms() const {
  return claims == 0 ? 0 : std::sqrt(distanceSquares / static_cast<double>(claims));
}

RigidTruth::RigidTruth(const scenes::SceneMesh& body) {
  if (!findMeshDefects(body.triangles).closed()) m_inside.rule = InsideRule::WindingNumber;
  m_body = m_detection.addTriangleMesh(body.positions, body.triangles);
}

std::vector<SignedDistance> RigidTruth::of(std::span<const Vector3d> points) {
  std::vector<SignedDistance> truth(points.size());
  m_detection.queries().signedDistances(m_body, points, truth, m_inside);
  return truth;
}

}  // namespace palpate::accuracy
