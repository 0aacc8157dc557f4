#include "Common/Model.h"

#include <algorithm>

namespace palpate::testing {

namespace {

std::uint32_t hashOf(const ContactFeatures& features) {
  return features.a[0] * 2654435761u ^ features.b[0] * 40503u ^ features.a[1] ^ features.b[1] * 7u ^
         static_cast<std::uint32_t>(features.kind) ^ features.tagA * 5u ^ features.tagB * 3u;
}

/// Tags by the place of the element.
Ids placedTags(const ModelBody& body, bool asSurface) {
  if (body.tags.empty() || !body.hasVertices()) return body.tags;
  if (!body.tetrahedra.empty() && !asSurface) return body.tags;
  Ids tags;
  for (const std::uint32_t id : body.ids())
    tags.push_back(body.tags[asSurface ? body.tetrahedronOf[id] : id]);
  return tags;
}

}  // namespace

std::size_t ModelBody::elements() const {
  if (!hasVertices()) return 0;
  return geometry.type == GeometryType::Points  ? geometry.positions.size()
         : geometry.type == GeometryType::Lines ? geometry.segments.size()
                                                : geometry.triangles.size() + removed.size();
}

Ids ModelBody::placesOf(const Ids& elements) const {
  const Ids all = ids();
  Ids places;
  for (const std::uint32_t id : elements)
    if (const auto found = std::lower_bound(all.begin(), all.end(), id);
        found != all.end() && *found == id)
      places.push_back(static_cast<std::uint32_t>(found - all.begin()));
  return places;
}

std::size_t ModelBody::tagCount() const {
  return !hasVertices() ? 1 : tetrahedra.empty() ? elements() : tetrahedra.size();
}

ContactPredicate predicateOf(int number, Ids ofA, Ids ofB) {
  if (number == 0) return {};
  return [number, ofA = std::move(ofA), ofB = std::move(ofB)](ContactFeatures features) {
    using Kind = ContactFeatures::Kind;
    if (features.kind == Kind::TriangleVertex && !ofA.empty()) features.a.fill(ofA[features.a[0]]);
    if (features.kind == Kind::VertexTriangle && !ofB.empty()) features.b.fill(ofB[features.b[0]]);
    return hashOf(features) % 5 != static_cast<std::uint32_t>(number);
  };
}

namespace {

Positions placedBy(const Pose& pose, const Positions& positions) {
  Positions placed;
  for (const Vector3d& p : positions) placed.push_back(pose(p));
  return placed;
}

}  // namespace

Positions ModelBody::beforeInWorld() const {
  return placed ? placedBy(poseBefore, before) : before;
}
Positions ModelBody::nowInWorld() const { return placed ? placedBy(pose, now) : now; }

ModelPair* Model::find(GeometryId a, GeometryId b) {
  const auto pair = std::ranges::find_if(
      pairs, [&](const ModelPair& p) { return (p.a == a && p.b == b) || (p.a == b && p.b == a); });
  return pair == pairs.end() ? nullptr : &*pair;
}

void Model::removeGeometry(GeometryId id) {
  bodies.erase(id);
  std::erase_if(pairs, [=](const ModelPair& pair) { return pair.a == id || pair.b == id; });
}

void Model::advance() {
  for (auto& [id, body] : bodies) {
    body.before = body.now;
    body.poseBefore = body.pose;
    body.isNew = body.bodyGiven = body.transformGiven = false;
  }
}

GeometryId addBody(OctreeBasedCD& collisions, const ModelBody& body) {
  if (body.shape) return collisions.addAnalyticalGeometry(*body.shape);
  if (body.isField()) return collisions.addDistanceField(body.field);
  const bool isSolid = !body.tetrahedra.empty() && body.removedTetrahedra.empty();
  return isSolid ? collisions.addTetrahedralMesh(body.geometry.positions, body.tetrahedra)
                 : body.geometry.addTo(collisions);
}

NewObject newObject(const Model& model, const Settings& settings, bool inWorld) {
  NewObject made{OctreeBasedCD(settings), {}};
  OctreeBasedCD& collisions = made.object;
  for (const auto& [id, body] : model.bodies) {
    const GeometryId own = addBody(collisions, body);
    made.ids.emplace(id, own);
    if (body.field && !body.isField()) collisions.attachDistanceField(own, body.field);
    if (body.leaves) collisions.attachSurfaceProxy(own, body.leaves);
    const bool toWorld = inWorld && body.hasVertices() && !body.isRigid();
    if (toWorld && body.placed) {
      collisions.setPositions(own, body.beforeInWorld(), body.nowInWorld());
    } else {
      if (body.hasVertices() && !body.isRigid())
        collisions.setPositions(own, body.before, body.now);
      if (body.placed) collisions.setTransform(own, body.poseBefore, body.pose);
    }
    collisions.setCollisionFilter(own, body.filter);
    if (!body.disabled.empty()) collisions.setDisabledElements(own, body.placesOf(body.disabled));
    collisions.setTags(own, placedTags(body, !body.removedTetrahedra.empty()));
  }
  for (const ModelPair& pair : model.pairs) {
    const GeometryId a = made.ids.at(pair.a), b = made.ids.at(pair.b);
    collisions.addCollisionPair(a, b, pair.settings);
    if (pair.predicate)
      collisions.setContactPredicate(a, b,
                                     predicateOf(pair.predicate, model.bodies.at(pair.a).ids(),
                                                 model.bodies.at(pair.b).ids()));
  }
  return made;
}

}  // namespace palpate::testing
