#pragma once

#include <palpate/Settings.h>
#include <palpate/SpatialQueries.h>

#include "Queries/BeamHits.h"
#include "Queries/BodyPenetration.h"
#include "Queries/PairTraversal.h"
#include "Queries/PathIntervals.h"
#include "Queries/PointDistances.h"
#include "Queries/RayHits.h"
#include "Queries/VertexSearch.h"
#include "Bodies/Body.h"
#include "Contact/DistinctShapeContacts.h"
#include "Shapes/PlacedShape.h"
#include "Shapes/ShapeContacts.h"
#include "Core/FloatingPoint.h"
#include "Core/MemoryBudget.h"
#include "Core/Threads.h"

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <utility>
#include <vector>

namespace palpate {

/// The geometries that SpatialQueries search, and the scratch of their calls. The owner of the
/// geometries implements the virtual functions. The queries are defined by question, in
/// NearestQueries.cpp, RayQueries.cpp, OverlapQueries.cpp, InsideQueries.cpp, DistanceQueries.cpp,
/// PathQueries.cpp and RigidMesh.cpp.
class SpatialQueries::Source {
 public:
  /// Scratch of one call, which remembers its peak.
  struct Scratch : CountedObject {
    PointQueryStack stack;
    VertexSearch<InsideVertex> inside;
    VertexSearch<EmbeddedVertex> embedded;
    std::vector<PointDistances::Near> near;
    std::vector<RayHits::Met> met;
    std::array<std::vector<RayHits::Met>, kRaysInFlight> metInFlight;
    BeamHits::Scratch beam;
    std::vector<RayHit> hits;
    std::vector<std::vector<RayHit>> hitsOfParts;  ///< of allHits() of many rays
    std::vector<std::size_t> begins;
    std::vector<std::uint32_t> elements;
    Buffer<std::uint32_t> nearShape;
    ShapeContactBuffers shapeContacts;
    DistinctShapeContacts distinctContacts;
    KeptShapes shapes;
    PathScratch path;
    std::unique_ptr<PairScratch> pairs;  ///< null before distance() first needs it
    PenetrationScratch penetration;
    std::vector<std::uint64_t> bits;

    /// Replaces `out` by `elements`, which are different numbers, in ascending order. If it throws,
    /// `out` is as before.
    void giveSorted(std::vector<std::uint32_t>& out);
  };
  /// What all sources of one owner share: the scratch that no call uses.
  class Pool {
   public:
    /// budget: null for none.
    explicit Pool(std::shared_ptr<MemoryBudget> budget = nullptr);
    std::uint64_t id() const { return m_id; }  ///< unique in the process
    ~Pool();
    std::unique_ptr<Scratch> take();
    void giveBack(std::unique_ptr<Scratch>);
    void release();  ///< frees all scratch that no call uses
    const std::shared_ptr<MemoryBudget>& budget() const { return m_budget; }

   private:
    const std::uint64_t m_id;
    const std::shared_ptr<MemoryBudget> m_budget;
    std::atomic<Scratch*> m_spare = nullptr;  ///< the one that is likely to be lent next
    std::mutex m_mutex;
    std::vector<std::unique_ptr<Scratch>> m_free;
  };
  /// Scratch lent to one call. While it is, memory counts toward the owner's budget.
  class Loan {
   public:
    explicit Loan(Source& source)
        : m_memory(source.m_pool->budget(), MemoryStage::Queries),
          m_pool(*source.m_pool),
          m_scratch(m_pool.take()) {}
    ~Loan() { m_pool.giveBack(std::move(m_scratch)); }
    Loan(const Loan&) = delete;
    Loan& operator=(const Loan&) = delete;
    Scratch* operator->() const { return m_scratch.get(); }

   private:
    const MemoryScope m_memory;
    Pool& m_pool;
    std::unique_ptr<Scratch> m_scratch;
  };

  explicit Source(std::shared_ptr<Pool> pool = std::make_shared<Pool>())
      : m_pool(std::move(pool)) {}
  virtual ~Source() = default;

  static SpatialQueries queries(std::shared_ptr<Source> source) {
    return SpatialQueries(std::move(source));
  }
  static Source& of(const SpatialQueries& queries) { return queries.valid(); }

  /// A number for the present state of all geometries. 0: the octrees are not up to date, or the
  /// owner or the snapshot is gone.
  virtual std::uint64_t state() const = 0;
  /// Throws UnknownGeometry.
  virtual const Body& at(GeometryId) const = 0;
  /// All geometries, by ascending ids.
  virtual std::size_t geometryCount() const = 0;
  virtual const Body& geometry(std::size_t index) const = 0;
  virtual std::uint64_t step() const = 0;  ///< counts advance()
  virtual Engine engine() const = 0;
  virtual const OctreeSettings& octreeSettings() const = 0;
  virtual const Threads& threads() const = 0;

  const std::shared_ptr<MemoryBudget>& budget() const { return m_pool->budget(); }
  void releaseScratch() { m_pool->release(); }
  std::uint64_t id() const { return m_pool->id(); }  ///< of the owner; unique in the process

  /// The threads for one call: the pool, or a single thread while another call uses the pool.
  class Workers {
   public:
    explicit Workers(Source& source)
        : m_lock(source.m_threadsMutex, std::try_to_lock),
          m_threads(m_lock ? source.threads() : source.m_singleThread) {}
    operator const Threads&() const { return m_threads; }

   private:
    std::unique_lock<std::mutex> m_lock;
    const Threads& m_threads;
  };

  /// One call of a query: its valid source, and the standard floating-point environment.
  class Call {
   public:
    explicit Call(const SpatialQueries& queries) : m_source(queries.valid()) {}
    Source* operator->() const { return &m_source; }
    Source& operator*() const { return m_source; }

   private:
    Source& m_source;
    const StandardFloatingPoint m_standard;
  };

  // Update the structures that are made when a query first needs them. Run by one thread at a time
  // for each geometry.
  void prepareInside(const Body& body, const InsideSettings&);
  void prepareTetrahedra(const Body& solid);
  /// For InsideRule::Closed; returns false for a body without an inside.
  bool prepareIfClosed(const Body& body);

 private:
  const std::shared_ptr<Pool> m_pool;
  Threads m_singleThread{1};
  std::mutex m_threadsMutex;  ///< locked while a call uses threads()
};

/// Throws InvalidSettings if both geometries are the same, and UnsupportedMethod if `vertices` is a
/// shape.
void checkVertices(const Body& vertices, GeometryId body);
/// Throws NonFinitePosition. index: of a batch.
void checkPoint(const Eigen::Vector3d& point, std::optional<std::size_t> index = {});
void checkPoints(std::span<const Eigen::Vector3d>);
/// Throws InvalidSettings unless there is room for as many answers as are asked for.
void checkSizes(std::size_t asked, std::size_t room, const char* name);
constexpr std::size_t kPartOfBatch = 64;  ///< questions
/// Calls f(begin, end) for parts of a batch, on all threads.
template <class F>
void forParts(SpatialQueries::Source& source, std::size_t size, F&& f) {
  const SpatialQueries::Source::Workers workers(source);
  const Threads& threads = workers;
  threads.forChunks(size, kPartOfBatch,
                    [&](std::size_t, std::size_t begin, std::size_t end) { f(begin, end); });
}
/// Throws InvalidSettings for a length that is negative, NaN or, if `finite`, out of range.
void checkLength(double length, const char* name, bool finite);
/// Throws UnsupportedMethod for an analytical shape.
void checkHasElements(const Body&);
/// The pose that is used for one that a user passes (withExactRotation()). Throws InvalidTransform.
/// what: the start of the message.
Pose checkedPose(const Pose&, const char* what);

}  // namespace palpate
