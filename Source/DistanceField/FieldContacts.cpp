#include "DistanceField/FieldContacts.h"

#include "DistanceField/FieldCells.h"
#include "DistanceField/FieldMinimum.h"
#include "Bodies/OctreeFrame.h"
#include "Shapes/Shape.h"
#include "Math/Tolerances.h"
#include "Core/Assert.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

namespace palpate {

using Eigen::Vector3d;

namespace {

/// Points whose values are found at once: enough for SIMD lanes, and few enough for the stack.
constexpr std::size_t kValuesAtOnce = 128;

}  // namespace

PlacedField::PlacedField(const DistanceField& field, const Positions& body)
    : m_field(field), m_lookup(DistanceField::Implementation::lookupOf(field)) {
  if (!body.isPlaced()) return;
  m_pose = {orthonormal(body.transform().rotation), body.transform().translation};
  m_turned = (body.transform().rotation - m_pose.rotation).norm();
}

Vector3d PlacedField::inField(const Vector3d& world) const {
  const Vector3d from = world - m_pose.translation;
  const Eigen::Matrix3d& r = m_pose.rotation;
  const auto along = [&](int k) {
    return r(0, k) * from[0] + r(1, k) * from[1] + r(2, k) * from[2];
  };
  return {along(0), along(1), along(2)};
}

Vector3d PlacedField::normalAt(const Vector3d& inField) const {
  const Vector3d gradient = m_lookup.gradient(inField);
  if (gradient == Vector3d::Zero()) return m_pose.rotation.col(2);
  const Eigen::Matrix3d& r = m_pose.rotation;
  const auto along = [&](int k) {
    return r(k, 0) * gradient[0] + r(k, 1) * gradient[1] + r(k, 2) * gradient[2];
  };
  return Vector3d(along(0), along(1), along(2)).stableNormalized();
}

Eigen::AlignedBox3d PlacedField::domain() const {
  const FieldCells& cells = m_lookup.cells();
  Eigen::AlignedBox3d box;
  for (int corner = 0; corner < 8; ++corner) {
    Vector3d at;
    for (int k = 0; k < 3; ++k)
      at[k] = std::ldexp(static_cast<double>(cells.origin[k] +
                                             (corner >> k & 1 ? std::int64_t{cells.size[k]} : 0)),
                         cells.exponent);
    box.extend(m_pose(at));
  }
  const double error =
      kShapeBoundError * (box.min().cwiseAbs().maxCoeff() + box.max().cwiseAbs().maxCoeff() +
                          m_pose.translation.cwiseAbs().maxCoeff());
  return {box.min() - Vector3d::Constant(error), box.max() + Vector3d::Constant(error)};
}

double PlacedField::placementError() const {
  const FieldCells& cells = m_lookup.cells();
  Vector3d furthest;  // a corner of the domain, which holds the mesh
  for (int k = 0; k < 3; ++k) {
    const auto lower = static_cast<double>(cells.origin[k]), upper = lower + cells.size[k];
    furthest[k] = std::ldexp(std::max(std::abs(lower), std::abs(upper)), cells.exponent);
  }
  const double size = furthest.norm();
  return m_turned * size + kShapeBoundError * (size + m_pose.translation.cwiseAbs().maxCoeff());
}

double reachOf(const DistanceField& field) { return field.band() - field.errorBound(); }

double depthToleranceOf(const DistanceField& field) {
  return std::max(kDepthShare * field.errorBound(), kLeastDepthTolerance * field.band());
}

namespace {

constexpr double kNoDistance = std::numeric_limits<double>::infinity();

/// Decides which features of a mesh are contacts, and at which points.
class FeaturesNearField {
 public:
  /// skips: passes over edges and triangles that bounds exclude.
  FeaturesNearField(const TriangleMesh& mesh, const PlacedField& field, Contacts contacts,
                    double thickness, bool skips, ShapeContactBuffers& out)
      : m_mesh(mesh),
        m_field(field),
        m_thickness(thickness),
        m_reportsAll(contacts == Contacts::All),
        m_skips(skips && field.field().isClosed()),
        m_reach(reachOf(field.field())),
        m_band(field.field().band()),
        m_tolerance(depthToleranceOf(field.field())),
        m_error(2.0 * field.field().errorBound()),
        m_out(out) {}

  double valueAt(std::uint32_t vertex) const {
    return m_field.lookup().value(m_field.inField(m_mesh.now[vertex]));
  }

  /// value: L, of the field, here and below.
  void findVertex(std::uint32_t v, double value) {
    ++m_out.featurePairs;
    if (value - m_mesh.radius(v) <= m_thickness)
      add(ShapeElement::Vertex, v, {v, v, v}, Vector3d::UnitX());
  }

  /// Returns the value, less the radius, of a point that is deeper than both ends; infinity if
  /// there is none. isOwn: whether a contact is reported.
  double findEdge(const Segment& edge, const std::array<double, 2>& values, bool isOwn) {
    ++m_out.featurePairs;
    const auto& [p, q] = edge;
    const std::array<double, 2> radii{m_mesh.radius(p), m_mesh.radius(q)};
    const std::array<double, 2> ends{values[0] - radii[0], values[1] - radii[1]};
    const double boundary = std::min(ends[0], ends[1]), target = targetBelow(boundary);
    std::optional<DeepPoint> deep;
    if (!excludes(values, std::array{p, q}, target))
      deep = findDeepPoint(m_field.lookup(), std::array{inField(p), inField(q)}, radii, target,
                           m_tolerance);
    const Triangle vertices{p, q, q};
    if (isOwn && deep) add(ShapeElement::Edge, p, vertices, deep->weights, &*deep);
    if (isOwn && !deep && m_reportsAll && boundary <= m_thickness)
      add(ShapeElement::Edge, p, vertices,
          ends[0] <= ends[1] ? Vector3d::UnitX() : Vector3d::UnitY());
    return deep ? deep->value : kNoDistance;
  }

  /// least: what findEdge() returned for each edge; edge i joins corners i and i + 1.
  void findFace(std::uint32_t triangle, const std::array<double, 3>& values,
                const std::array<double, 3>& least) {
    ++m_out.featurePairs;
    const Triangle& corners = m_mesh.topology.elements[triangle];
    const double boundary =
                     std::min({values[0], values[1], values[2], least[0], least[1], least[2]}),
                 target = targetBelow(boundary);
    std::optional<DeepPoint> deep;
    if (!excludes(values, corners, target))
      deep =
          findDeepPoint(m_field.lookup(),
                        std::array{inField(corners[0]), inField(corners[1]), inField(corners[2])},
                        std::array{0.0, 0.0, 0.0}, target, m_tolerance);
    if (deep) return add(ShapeElement::Face, triangle, corners, deep->weights, &*deep);
    if (!m_reportsAll || !(boundary <= m_thickness)) return;
    for (int i = 0; i < 3; ++i) {
      if (values[i] == boundary)
        return add(ShapeElement::Face, triangle, corners, Vector3d::Unit(i));
      if (least[i] != boundary) continue;
      const Segment edge{std::min(corners[i], corners[(i + 1) % 3]),
                         std::max(corners[i], corners[(i + 1) % 3])};
      const bool turned = edge[0] != corners[i];
      const auto onEdge = findDeepPoint(
          m_field.lookup(), std::array{inField(edge[0]), inField(edge[1])}, std::array{0.0, 0.0},
          targetBelow(std::min(values[i], values[(i + 1) % 3])), m_tolerance);
      PALPATE_ASSERT(onEdge.has_value());
      Vector3d weights = Vector3d::Zero();
      weights[turned ? (i + 1) % 3 : i] = onEdge->weights[0];
      weights[turned ? i : (i + 1) % 3] = onEdge->weights[1];
      return add(ShapeElement::Face, triangle, corners, weights, &*onEdge);
    }
  }

  /// Whether the field, less the radius, is certainly above `target` less the tolerance, on a whole
  /// element. valueOf(vertex): L, of the field.
  template <class ValueOf>
  bool isAbove(std::uint32_t element, double target, ValueOf&& valueOf) const {
    const Triangle& corners = m_mesh.topology.elements[element];
    if (m_mesh.topology.hasFaces()) return isAbove(corners, target, valueOf);
    return isAbove(Segment{corners[0], corners[1]}, target, valueOf);
  }

 private:
  Vector3d inField(std::uint32_t vertex) const { return m_field.inField(m_mesh.now[vertex]); }

  double targetBelow(double boundary) const {
    return std::min(boundary - m_tolerance, m_thickness);
  }

  /// Whether the field, less the radius, is certainly above the target on the whole feature.
  ///
  /// Let v be a corner and x another point of the feature, with the value g(x) <= target, which is
  /// below the reach. Then g(x) >= d(x) - e. If g(v) is above -reach, then g(v) <= d(v) + e. The
  /// distance d changes by at most |x - v|. So g(x) >= g(v) - 2 e - |x - v|. Each point of a
  /// segment is at most half its length from an end, and each point of a triangle at most its
  /// longest side over the root of 3 from a corner.
  ///
  /// All this is of a closed mesh, where d changes so little. Of others nothing is passed over.
  template <std::size_t size>
  bool excludes(const std::array<double, size>& values,
                const std::array<std::uint32_t, size>& vertices, double target) const {
    if (!m_skips) return false;
    if (target < -m_band - m_mesh.largestRadius) return true;  // no value is below
    const auto [lowest, highest] = std::minmax_element(values.begin(), values.end());
    if (!(*lowest > -m_reach)) return false;
    double square = 0.0;
    for (std::size_t i = 0; i < size; ++i)
      square = std::max(
          square, (m_mesh.now[vertices[(i + 1) % size]] - m_mesh.now[vertices[i]]).squaredNorm());
    const double length = (1.0 + kFieldLengthError) * std::sqrt(square);
    const double bound = size == 2 ? 0.5 * (values[0] + values[1] - length)
                                   : std::max(*lowest - kRootOfThird * length, *highest - length);
    return bound - m_error - m_mesh.largestRadius > target;
  }

  template <std::size_t size, class ValueOf>
  bool isAbove(const std::array<std::uint32_t, size>& vertices, double target,
               ValueOf& valueOf) const {
    std::array<double, size> values, radii;
    std::array<Vector3d, size> corners;
    for (std::size_t i = 0; i < size; ++i) {
      values[i] = valueOf(vertices[i]), radii[i] = m_mesh.radius(vertices[i]);
      if (!(values[i] - radii[i] > target)) return false;
    }
    const bool isPoint = size == 2 && vertices.front() == vertices.back();
    if (isPoint || excludes(values, vertices, target)) return true;
    for (std::size_t i = 0; i < size; ++i) corners[i] = inField(vertices[i]);
    return !findDeepPoint(m_field.lookup(), corners, radii, target, m_tolerance);
  }

  /// Adds the contact if the value at its point, as the field has it, is within the thickness. The
  /// value of an open mesh may jump there: that of `deep` is the lower one.
  void add(ShapeElement element, std::uint32_t id, const Triangle& vertices,
           const Vector3d& weights, const DeepPoint* deep = nullptr) {
    Vector3d point = m_mesh.now[vertices[0]];
    if (element != ShapeElement::Vertex)
      point = (weights[0] * point + weights[1] * m_mesh.now[vertices[1]]) +
              weights[2] * m_mesh.now[vertices[2]];
    const Vector3d inField = m_field.inField(point);
    const double radius = m_mesh.radius(vertices, weights);
    double value = m_field.lookup().value(inField), distance = value - radius;
    if (deep && !(distance <= m_thickness) && !m_field.field().isClosed())
      distance = deep->value, value = distance + radius;
    if (!(distance <= m_thickness)) return;
    const Vector3d normal = m_field.normalAt(inField);
    m_out.shape.push_back(
        {element, id, vertices, weights, point, point - value * normal, normal, distance, 1.0});
  }

  const TriangleMesh& m_mesh;
  const PlacedField& m_field;
  const double m_thickness;
  const bool m_reportsAll, m_skips;
  const double m_reach, m_band, m_tolerance, m_error;
  ShapeContactBuffers& m_out;
};

/// L: the value, less the radius, that all points of a mesh must exceed for isFurther().
double valueBeyond(const PlacedField& placed, double distance) {
  return distance * (1.0 + kFieldLengthError) + placed.field().errorBound() +
         placed.placementError() + depthToleranceOf(placed.field());
}

/// Calls visit(element), until it returns false, for the elements of nodes that may have a point
/// with a value of at most `limit`, which is below the reach, and for some more.
///
/// The bound is that of FeaturesNearField::excludes(), from the centre of a node's box.
template <class Visit>
void forEachElementNear(const Body& geometry, const PlacedField& placed, double limit,
                        Visit&& visit) {
  const Octree& octree = geometry.tree.octree();
  if (octree.size() == 0) return;
  const Eigen::AlignedBox3d region = placed.domain();
  const OctreeFrame frame(geometry);
  const BoxMap map = frame.toWorld();
  const Vector3d& origin = frame.origin();
  const double error = kShapeBoundError *
                       (region.min().cwiseAbs().maxCoeff() + region.max().cwiseAbs().maxCoeff() +
                        2.0 * origin.cwiseAbs().maxCoeff()),
               reach = reachOf(placed.field()),
               above = limit + 2.0 * placed.field().errorBound() + error;
  const Vector3d margin = Vector3d::Constant(error);
  const Eigen::AlignedBox3d grown(region.min() - origin - margin, region.max() - origin + margin);
  const auto mayBeNear = [&](const FloatBox& stored) {
    const auto box = frame.lengthsOf(map(stored));
    if (!box) return true;
    if (!grown.intersects(*box)) return false;
    if (!placed.field().isClosed()) return true;  // the sign may change between two points
    const double value = placed.lookup().distanceBound(placed.inField(box->center() + origin)),
                 bound = value - (1.0 + kFieldLengthError) * (0.5 * box->sizes()).norm();
    return !(value > -reach && bound > above);
  };
  const auto mayBeInDomain = [&](const FloatBox& stored) {
    const auto box = frame.lengthsOf(map(stored));
    return !box || grown.intersects(*box);
  };
  bool goesOn = true;
  forEachOverlapping(
      octree, [&](const FloatBox& box) { return goesOn && mayBeNear(box); },
      [&](std::uint32_t begin, std::uint32_t end) {
        for (std::uint32_t i = begin; i < end && goesOn; ++i)
          if (mayBeInDomain(octree.boxes()[i])) goesOn = visit(octree.order()[i]);
      });
}

}  // namespace

FieldContacts::FieldContacts(const TriangleMesh& mesh, const PlacedField& field, Contacts contacts,
                             double thickness, FieldScratch& scratch)
    : m_mesh(mesh),
      m_field(field),
      m_contacts(contacts),
      m_thickness(thickness),
      m_scratch(scratch) {}

void FieldContacts::startValues() {
  FieldScratch& scratch = m_scratch;
  const std::size_t count = m_mesh.topology.vertexCount;
  if (++scratch.stamp == 0) scratch.stamp = 1, scratch.stamps.clear();
  if (scratch.stamps.size() < count) scratch.stamps.resize(count, 0u);
  if (scratch.values.size() < count) scratch.values.resize(count);
}

bool FieldContacts::isFurther(const Body& geometry, double distance) {
  PALPATE_ASSERT(distance >= 0.0);
  const MeshTopology& topology = m_mesh.topology;
  const double target = valueBeyond(m_field, distance);
  if (!(target + m_mesh.largestRadius < reachOf(m_field.field()))) return false;
  startValues();
  ShapeContactBuffers none;
  const FeaturesNearField features(m_mesh, m_field, m_contacts, m_thickness, true, none);
  const auto isAbove = [&](std::uint32_t element) {
    return !topology.isEnabled(element) || features.isAbove(element, target, [&](std::uint32_t v) {
      double& value = m_scratch.values[v];
      if (m_scratch.stamps[v] != m_scratch.stamp) value = features.valueAt(v);
      m_scratch.stamps[v] = m_scratch.stamp;
      return value;
    });
  };
  std::uint32_t& nearest = m_scratch.nearest;
  if (nearest < topology.elements.size() && !isAbove(nearest)) return false;
  bool isFurther = true;
  forEachElementNear(geometry, m_field, target + m_mesh.largestRadius, [&](std::uint32_t element) {
    isFurther = isAbove(element);
    if (!isFurther) nearest = element;
    return isFurther;
  });
  return isFurther;
}

bool FieldContacts::isFurtherByBruteForce(double distance) const {
  const double target = valueBeyond(m_field, distance);
  if (!(target + m_mesh.largestRadius < reachOf(m_field.field()))) return false;
  ShapeContactBuffers none;
  const FeaturesNearField features(m_mesh, m_field, m_contacts, m_thickness, false, none);
  const auto size = static_cast<std::uint32_t>(m_mesh.topology.elements.size());
  for (std::uint32_t element = 0; element < size; ++element)
    if (m_mesh.topology.isEnabled(element) &&
        !features.isAbove(element, target, [&](std::uint32_t v) { return features.valueAt(v); }))
      return false;
  return true;
}

void FieldContacts::start(const Body& geometry) {
  PALPATE_ASSERT(m_thickness + m_mesh.largestRadius < reachOf(m_field.field()));
  PALPATE_ASSERT(geometry.tree.encloses(m_mesh, geometry.revisions.elements.topology));
  const MeshTopology& topology = m_mesh.topology;
  FieldScratch& scratch = m_scratch;
  scratch.elements.clear();
  forEachElementNear(geometry, m_field, m_thickness + m_mesh.largestRadius,
                     [&](std::uint32_t element) {
                       if (topology.isEnabled(element)) scratch.elements.push_back(element);
                       return true;
                     });
  startValues();
  if (scratch.least.size() < topology.edges.size()) scratch.least.resize(topology.edges.size());
  scratch.vertices.clear();
  for (const std::uint32_t element : scratch.elements) {
    for (const std::uint32_t v : topology.elements[element]) {
      if (scratch.stamps[v] == scratch.stamp) continue;
      scratch.stamps[v] = scratch.stamp;
      scratch.vertices.push_back(v);
    }
    // An edge whose owner is not among the elements has no point within the thickness.
    for (const std::uint32_t edge : topology.triangleEdges[element])
      if (edge != kNoEdge) scratch.least[edge] = kNoDistance;
  }
}

void FieldContacts::findValues(std::size_t begin, std::size_t end) {
  PALPATE_ASSERT(begin <= end && end <= m_scratch.vertices.size());
  std::array<Vector3d, kValuesAtOnce> points;
  std::array<double, kValuesAtOnce> values;
  for (std::size_t first = begin; first < end; first += kValuesAtOnce) {
    const std::size_t size = std::min(kValuesAtOnce, end - first);
    const std::uint32_t* const vertices = m_scratch.vertices.data() + first;
    for (std::size_t i = 0; i < size; ++i) points[i] = m_field.inField(m_mesh.now[vertices[i]]);
    m_field.lookup().values({points.data(), size}, values.data());
    for (std::size_t i = 0; i < size; ++i) m_scratch.values[vertices[i]] = values[i];
  }
}

void FieldContacts::findEdges(std::size_t begin, std::size_t end, ShapeContactBuffers& out) {
  PALPATE_ASSERT(begin <= end && end <= m_scratch.elements.size());
  const MeshTopology& topology = m_mesh.topology;
  const Buffer<double>& values = m_scratch.values;
  FeaturesNearField features(m_mesh, m_field, m_contacts, m_thickness, true, out);
  for (std::size_t n = begin; n < end; ++n) {
    const std::uint32_t element = m_scratch.elements[n];
    for (int i = 0; i < 3; ++i) {
      const std::uint32_t v = topology.elements[element][i],
                          edge = topology.triangleEdges[element][i];
      if (topology.ownsCorner(element, i)) features.findVertex(v, values[v]);
      if (!topology.ownsEdge(element, i)) continue;
      const auto& [p, q] = topology.edges[edge];
      m_scratch.least[edge] = features.findEdge({p, q}, {values[p], values[q]}, true);
    }
  }
}

void FieldContacts::findFaces(std::size_t begin, std::size_t end, ShapeContactBuffers& out) {
  PALPATE_ASSERT(begin <= end && end <= m_scratch.elements.size());
  const MeshTopology& topology = m_mesh.topology;
  if (!topology.hasFaces()) return;
  FeaturesNearField features(m_mesh, m_field, m_contacts, m_thickness, true, out);
  for (std::size_t n = begin; n < end; ++n) {
    const std::uint32_t element = m_scratch.elements[n];
    std::array<double, 3> values, least;
    for (int i = 0; i < 3; ++i) {
      const std::uint32_t edge = topology.triangleEdges[element][i];
      values[i] = m_scratch.values[topology.elements[element][i]];
      least[i] = edge == kNoEdge ? kNoDistance : m_scratch.least[edge];
    }
    features.findFace(element, values, least);
  }
}

void FieldContacts::findByBruteForce(const TriangleMesh& mesh, const PlacedField& field,
                                     Contacts contacts, double thickness,
                                     std::span<const std::uint32_t> elements,
                                     ShapeContactBuffers& out) {
  const MeshTopology& topology = mesh.topology;
  FeaturesNearField features(mesh, field, contacts, thickness, false, out);
  for (const std::uint32_t element : elements) {
    if (!topology.isEnabled(element)) continue;
    std::array<double, 3> values, least;
    for (int i = 0; i < 3; ++i) values[i] = features.valueAt(topology.elements[element][i]);
    for (int i = 0; i < 3; ++i) {
      least[i] = kNoDistance;
      if (topology.ownsCorner(element, i))
        features.findVertex(topology.elements[element][i], values[i]);
      if (topology.triangleEdges[element][i] == kNoEdge) continue;
      const Segment& edge = topology.edges[topology.triangleEdges[element][i]];
      least[i] = features.findEdge(edge, {features.valueAt(edge[0]), features.valueAt(edge[1])},
                                   topology.ownsEdge(element, i));
    }
    if (topology.hasFaces()) features.findFace(element, values, least);
  }
}

}  // namespace palpate
