// A sheet that lies on another one, the state in which bodies spend most of their time. A part of
// it may move fast, and the grids may be aligned.
#include "Rows.h"

#include <palpate/OctreeBasedCD.h>

#include <Scenes.h>

#include <cmath>
#include <cstdio>
#include <deque>
#include <utility>

namespace palpate::benchmark {
namespace {

using Points = std::vector<Eigen::Vector3d>;

constexpr int kCells = 53;  // 5,618 triangles
constexpr double kEdge = 2.0 / kCells, kThickness = kEdge / 10;

struct Sheet {
  Points rest;
  std::vector<Triangle> triangles;
  std::vector<bool> isFast;  ///< of each vertex
};

/// A sheet of which this share of the columns is fast.
Sheet sheetWith(double fastShare) {
  const scenes::SceneMesh mesh = scenes::sheet(kCells);
  Sheet sheet{mesh.positions, mesh.triangles, {}};
  for (const Eigen::Vector3d& p : sheet.rest) sheet.isFast.push_back(0.5 * (p.x() + 1) < fastShare);
  return sheet;
}

/// Only the triangles with a fast vertex. Vertices keep their numbers.
Sheet fastPart(Sheet sheet) {
  std::erase_if(sheet.triangles, [&](const Triangle& t) {
    return !sheet.isFast[t[0]] && !sheet.isFast[t[1]] && !sheet.isFast[t[2]];
  });
  return sheet;
}

/// One sheet on another, frame after frame.
class Resting {
 public:
  /// upper, lower: at rest, in contact. fast: the displacement of fast vertices from frame to
  /// frame, forth and back.
  Resting(Points lower, Sheet upper, PairSettings settings, const Eigen::Vector3d& fast)
      : m_lower(std::move(lower)), m_upper(std::move(upper)), m_fast(fast) {
    const auto triangles = scenes::sheet(kCells).triangles;
    m_ids[0] = m_detection.addTriangleMesh(m_lower, triangles);
    m_ids[1] = m_detection.addTriangleMesh(m_upper.rest, m_upper.triangles);
    m_detection.addCollisionPair(m_ids[0], m_ids[1], settings);
    next();
  }

  /// Milliseconds of the next two frames, of each one half.
  double time() {
    const double first = next();
    return 0.5 * (first + next());
  }
  std::size_t contacts() const { return m_detection.statistics().contacts; }

 private:
  double next() {
    m_forth = !m_forth;
    // Both sheets are shifted alike, so that no frame repeats the positions of the last one.
    const Eigen::Vector3d common(m_forth ? 0x1p-7 : 0.0, 0, 0),
        creep(0, 0, m_forth ? kEdge / 100 : 0.0);
    m_now[0] = m_lower;
    m_now[1] = m_upper.rest;
    for (Eigen::Vector3d& p : m_now[0]) p += common;
    for (std::size_t v = 0; v < m_now[1].size(); ++v) {
      m_now[1][v] += common + creep;
      if (m_forth && m_upper.isFast[v]) m_now[1][v] += m_fast;
    }
    const double start = now();
    for (int i = 0; i < 2; ++i) m_detection.setPositions(m_ids[i], m_now[i]);
    m_detection.detectCollision();
    m_detection.advance();
    return now() - start;
  }

  Points m_lower;
  Sheet m_upper;
  Eigen::Vector3d m_fast;
  OctreeBasedCD m_detection{{.threads = 1}};
  GeometryId m_ids[2];
  Points m_now[2];
  bool m_forth = true;
};

/// Medians of the scenes' times in turns, and reports them.
std::vector<double> measured(std::deque<Resting>& scenes, const RowOptions& options) {
  std::vector<std::vector<double>> samples(scenes.size());
  const int turns = 8 * (1 + options.measure.repetitions);
  for (int turn = 0; turn < turns; ++turn)
    for (std::size_t i = 0; i < scenes.size(); ++i) {
      const double spent = scenes[i].time();
      if (turn > 1) samples[i].push_back(spent);
    }
  std::vector<double> medians;
  for (auto& sample : samples) medians.push_back(median(std::move(sample)));
  return medians;
}

Points lifted(Points positions, const Eigen::Vector3d& by) {
  for (Eigen::Vector3d& p : positions) p += by;
  return positions;
}

/// Auto where a share of the sheet moves fast, beside Proximity, and Continuous of the fast part.
void partlyFastRows(Report& report, const RowOptions& options) {
  report.heading("A sheet of 5,618 triangles on another, of which a part moves fast, ms; 1 thread");
  report.line({"", "Proximity", "part", "Auto", "ratio"});
  const Eigen::Vector3d shift(0.3 * kEdge, 0.2 * kEdge, kEdge / 20);
  struct Motion {
    const char* name;
    double share;
    Eigen::Vector3d fast;
  };
  const Motion motions[] = {{"0 % fast", 0, Eigen::Vector3d::Zero()},
                            {"5 % fast", 0.05, kEdge * Eigen::Vector3d(0.1, 0.03, 0)},
                            {"5 % very fast", 0.05, kEdge * Eigen::Vector3d(0, 0, 2)},
                            {"30 % fast", 0.3, kEdge * Eigen::Vector3d(0.06, 0.02, 0)},
                            {"30 % very fast", 0.3, kEdge * Eigen::Vector3d(0, 0, 2)}};
  for (const auto& [name, share, fast] : motions) {
    Sheet sheet = sheetWith(share);
    Points lower = sheet.rest;
    sheet.rest = lifted(sheet.rest, shift);
    std::deque<Resting> scenes;
    scenes.emplace_back(lower, sheet,
                        PairSettings{.method = Method::Proximity, .thickness = kThickness},
                        Eigen::Vector3d::Zero());
    scenes.emplace_back(lower, sheet, PairSettings{.thickness = kThickness}, fast);
    if (share > 0)
      scenes.emplace_back(lower, fastPart(sheet),
                          PairSettings{.method = Method::Continuous, .thickness = kThickness},
                          fast);
    const std::vector<double> ms = measured(scenes, options);
    const double part = share > 0 ? ms[2] : 0.0, ratio = ms[1] / (ms[0] + part);
    report.line({name, milliseconds(ms[0]), milliseconds(part), milliseconds(ms[1]), times(ratio)});
    report.row("resting", name, 1, "sheet on a sheet", "Proximity ms", ms[0]);
    report.row("resting", name, 1, "sheet on a sheet", "Continuous of the fast part ms", part);
    report.row("resting", name, 1, "sheet on a sheet", "Auto ms", ms[1]);
    report.row("resting", name, 1, "sheet on a sheet", "Auto over both", ratio);
  }
}

/// Grids whose edges are parallel, with vertices above vertices, beside bumpy ones.
void alignedRows(Report& report, const RowOptions& options) {
  report.heading("Aligned and bumpy sheets of 5,618 triangles on each other, ms; 1 thread");
  report.line({"", "aligned", "bumpy", "ratio"});
  const Sheet flat = sheetWith(0);
  Points bumpy = flat.rest;
  for (std::size_t v = 0; v < bumpy.size(); ++v) {
    const auto i = static_cast<double>(v);
    bumpy[v] += kEdge * Eigen::Vector3d(0.1 * std::sin(7.3 * i), 0.1 * std::cos(3.1 * i), 0);
  }
  for (const Contacts contacts : {Contacts::Distinct, Contacts::All})
    for (const double gap : {0.05, 1e-4, 0.0}) {
      const PairSettings settings{
          .method = Method::Proximity, .thickness = kThickness, .contacts = contacts};
      const Eigen::Vector3d up(0, 0, gap * kEdge);
      Sheet above = flat, aboveBumpy = flat;
      above.rest = lifted(flat.rest, up);
      aboveBumpy.rest = lifted(flat.rest, up);
      std::deque<Resting> scenes;
      scenes.emplace_back(flat.rest, above, settings, Eigen::Vector3d::Zero());
      scenes.emplace_back(bumpy, aboveBumpy, settings, Eigen::Vector3d::Zero());
      const std::vector<double> ms = measured(scenes, options);
      char name[64];
      std::snprintf(name, sizeof name, "gap of %g edges, %s", gap,
                    contacts == Contacts::Distinct ? "Distinct" : "All");
      report.line({name, milliseconds(ms[0]), milliseconds(ms[1]), times(ms[0] / ms[1])});
      report.row("aligned", name, 1, "sheet on a sheet", "aligned ms", ms[0]);
      report.row("aligned", name, 1, "sheet on a sheet", "bumpy ms", ms[1]);
      report.row("aligned", name, 1, "sheet on a sheet", "ratio", ms[0] / ms[1]);
    }
}

}  // namespace

void restingRows(Report& report, const RowOptions& options) {
  partlyFastRows(report, options);
  alignedRows(report, options);
}

}  // namespace palpate::benchmark
