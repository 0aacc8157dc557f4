#include <palpate/SpatialQueries.h>

#include <palpate/Error.h>

#include "Core/FloatingPoint.h"
#include "Core/Text.h"
#include "Queries/Containment.h"
#include "Queries/Embedding.h"
#include "Queries/QuerySource.h"

#include <atomic>
#include <utility>

namespace palpate {

namespace {

std::uint64_t nextSourceId() {
  static std::atomic<std::uint64_t> last = 0;
  return ++last;
}

}  // namespace

SpatialQueries::Source::Source() : m_id(nextSourceId()) {}

SpatialQueries::Source::Loan::Loan(Source& source) : m_source(source) {
  {
    const std::lock_guard lock(source.m_scratchMutex);
    if (!source.m_freeScratch.empty()) {
      m_scratch = std::move(source.m_freeScratch.back());
      source.m_freeScratch.pop_back();
      return;
    }
  }
  m_scratch = std::make_unique<Scratch>();
}

SpatialQueries::Source::Loan::~Loan() {
  const std::lock_guard lock(m_source.m_scratchMutex);
  try {
    m_source.m_freeScratch.push_back(std::move(m_scratch));
  } catch (...) {  // no memory to keep it: the next call makes another
  }
}

void SpatialQueries::Source::prepareInside(SearchableGeometry& body,
                                           const InsideSettings& settings) {
  const std::lock_guard lock(m_preparationMutex);
  checkInside(body, settings);
  if (settings.rule == InsideRule::WindingNumber && body.tree.octree().size() > 0)
    body.windingNumbers.update(body, Workers(*this));
  else if (settings.rule == InsideRule::Closed && body.solid)
    updateTetrahedra(body, octreeSettings(), Workers(*this));
}

void SpatialQueries::Source::prepareTetrahedra(SearchableGeometry& solid) {
  const std::lock_guard lock(m_preparationMutex);
  updateTetrahedra(solid, octreeSettings(), Workers(*this));
}

void checkVertices(const SearchableGeometry& vertices, GeometryId body) {
  if (vertices.id == body)
    throw Error(ErrorCode::InvalidSettings,
                nameOf(body) + " is both the body and the owner of the vertices; these must differ",
                body);
  if (vertices.shape)
    throw Error(ErrorCode::UnsupportedMethod,
                nameOf(vertices.id) + " is a shape, which has no vertices", vertices.id);
}

SpatialQueries::SpatialQueries(std::shared_ptr<Source> source)
    : m_source(std::move(source)), m_state(m_source->state()) {}

SpatialQueries::Source& SpatialQueries::valid() const {
  if (!m_source) throw Error(ErrorCode::InvalidCall, "this SpatialQueries object was moved from");
  if (m_state == 0 || m_source->state() != m_state)
    throw Error(
        ErrorCode::InvalidCall,
        "this SpatialQueries object is outdated: positions, transforms, topology or geometries "
        "changed, advance() was called, or the OctreeBasedCD was destroyed; call "
        "queries() again");
  return *m_source;
}

void SpatialQueries::findInsideVertices(GeometryId vertices, GeometryId body,
                                        std::vector<InsideVertex>& out,
                                        const InsideSettings& settings) const {
  Source& source = valid();
  const StandardFloatingPoint standard;
  const SearchableGeometry& owner = source.at(vertices);
  SearchableGeometry& container = source.at(body);
  checkVertices(owner, body);
  source.prepareInside(container, settings);
  const Source::Loan scratch(source);
  findInside(owner, container, settings, source.engine(), Source::Workers(source), scratch->inside,
             out);
}

void SpatialQueries::findEmbeddedVertices(GeometryId vertices, GeometryId body,
                                          std::vector<EmbeddedVertex>& out) const {
  Source& source = valid();
  const StandardFloatingPoint standard;
  const SearchableGeometry& owner = source.at(vertices);
  SearchableGeometry& solid = source.at(body);
  checkVertices(owner, body);
  checkMeshType(solid, true, "findEmbeddedVertices() is for tetrahedral meshes");
  source.prepareTetrahedra(solid);
  const Source::Loan scratch(source);
  findEmbedded(owner, solid, source.engine(), Source::Workers(source), scratch->embedded, out);
}

std::optional<TetrahedronPoint> SpatialQueries::findTetrahedron(
    GeometryId body, const Eigen::Vector3d& point) const {
  Source& source = valid();
  const StandardFloatingPoint standard;
  SearchableGeometry& solid = source.at(body);
  checkMeshType(solid, true, "findTetrahedron() is for tetrahedral meshes");
  if (!point.allFinite())
    throw Error(ErrorCode::NonFinitePosition,
                nameOf(body) + ": the point is " + textOf(point) + "; it must be finite", body);
  source.prepareTetrahedra(solid);
  const Source::Loan scratch(source);
  return SolidQuery(solid, source.engine(), scratch->stack).lowest(point);
}

}  // namespace palpate
