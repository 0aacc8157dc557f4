#pragma once

#include <palpate/Settings.h>
#include <palpate/SpatialQueries.h>

#include "Core/Threads.h"
#include "Queries/SearchableGeometry.h"
#include "Queries/VertexSearch.h"

#include <cstdint>
#include <memory>
#include <mutex>
#include <vector>

namespace palpate {

/// What SpatialQueries search, with the scratch of their calls. Its owner implements the lookups.
class SpatialQueries::Source {
 public:
  /// Scratch of one call, which remembers its peak.
  struct Scratch {
    PointQueryStack stack;
    VertexSearch<InsideVertex> inside;
    VertexSearch<EmbeddedVertex> embedded;
  };
  /// Scratch lent to one call.
  class Loan {
   public:
    explicit Loan(Source&);
    ~Loan();
    Loan(const Loan&) = delete;
    Loan& operator=(const Loan&) = delete;
    Scratch* operator->() const { return m_scratch.get(); }

   private:
    Source& m_source;
    std::unique_ptr<Scratch> m_scratch;
  };

  Source();
  virtual ~Source() = default;

  /// Names one state of all geometries whose octrees are of the positions now. 0: there is none
  /// such now.
  virtual std::uint64_t state() const = 0;
  /// Throws UnknownGeometry.
  virtual SearchableGeometry& at(GeometryId) const = 0;
  virtual std::uint64_t step() const = 0;  ///< counts advance()
  virtual Engine engine() const = 0;
  virtual const OctreeSettings& octreeSettings() const = 0;
  virtual const Threads& threads() const = 0;

  std::uint64_t id() const { return m_id; }  ///< no other source of the process has it

  /// The threads for one call: one, where another call has the pool.
  class Workers {
   public:
    explicit Workers(Source& source)
        : m_lock(source.m_poolUse, std::try_to_lock),
          m_threads(m_lock ? source.threads() : source.m_one) {}
    operator const Threads&() const { return m_threads; }

   private:
    std::unique_lock<std::mutex> m_lock;
    const Threads& m_threads;
  };

  // Brings up to date what is made when a query first needs it; one thread at a time.
  void prepareInside(SearchableGeometry& body, const InsideSettings&);
  void prepareTetrahedra(SearchableGeometry& solid);

 protected:
  /// Held while octrees, or what queries add to them, are brought up to date.
  std::mutex m_preparing;

 private:
  const std::uint64_t m_id;
  Threads m_one{1};
  std::mutex m_poolUse;
  std::mutex m_lending;
  std::vector<std::unique_ptr<Scratch>> m_free;
};

/// Throws where the vertices of one geometry cannot be searched for in another:
/// InvalidSettings for one geometry twice, UnsupportedMethod for a shape as `vertices`.
void checkVertices(const SearchableGeometry& vertices, GeometryId body);

}  // namespace palpate
