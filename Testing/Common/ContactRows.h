#pragma once

#include <palpate/CollisionData.h>
#include <palpate/Settings.h>

#include "Common/RandomMeshes.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <limits>
#include <ostream>
#include <string>
#include <vector>

namespace palpate::testing {

/// f(contact) for each contact of two geometries with vertices.
template <class F>
void forEachContact(const CollisionData& data, F&& f) {
  for (const auto& c : data.vertexTriangle()) f(c);
  for (const auto& c : data.triangleVertex()) f(c);
  for (const auto& c : data.edgeEdge()) f(c);
}

/// L: the least distance of these contacts, or `least`.
inline double leastDistance(const CollisionData& data,
                            double least = std::numeric_limits<double>::infinity()) {
  forEachContact(data, [&](const auto& c) { least = std::min(least, c.distance); });
  return least;
}

/// The contacts over time of all lists, list by list.
inline std::vector<TrackedContact> allTracked(const CollisionData& data) {
  std::vector<TrackedContact> all;
  for (const auto list : {data.trackedVertexTriangle(), data.trackedTriangleVertex(),
                          data.trackedEdgeEdge(), data.trackedShape(), data.trackedShapeShape()})
    all.insert(all.end(), list.begin(), list.end());
  return all;
}

/// A contact as words: its ids, then the bits of every number.
using Row = std::vector<std::uint64_t>;

inline void append(Row& row, double value) { row.push_back(std::bit_cast<std::uint64_t>(value)); }
inline void append(Row& row, const Eigen::Vector3d& value) {
  for (const double x : value) append(row, x);
}

/// kTriangleFirst: the row is of triangleVertex(), which is sorted by the triangle.
template <bool kTriangleFirst>
Row rowOf(const VertexTriangleContact& c) {
  Row row{kTriangleFirst ? c.triangle : c.vertex, kTriangleFirst ? c.vertex : c.triangle,
          c.vertices[0], c.vertices[1], c.vertices[2]};
  append(row, c.weights);
  append(row, c.normal);
  append(row, c.distance);
  append(row, c.timeOfImpact);
  row.push_back(static_cast<std::uint64_t>(c.feature));
  return row;
}

inline Row rowOf(const VertexTriangleContact& c) { return rowOf<false>(c); }

inline Row rowOf(const EdgeEdgeContact& c) {
  Row row{c.edgeA[0], c.edgeA[1], c.edgeB[0], c.edgeB[1]};
  append(row, c.weightA);
  append(row, c.weightB);
  append(row, c.normal);
  append(row, c.distance);
  append(row, c.timeOfImpact);
  row.push_back(static_cast<std::uint64_t>(c.featureA));
  row.push_back(static_cast<std::uint64_t>(c.featureB));
  return row;
}

/// Rows of contacts that are in any order.
template <class List>
std::vector<Row> sortedRows(const List& contacts) {
  std::vector<Row> rows;
  for (const auto& contact : contacts) rows.push_back(rowOf(contact));
  std::sort(rows.begin(), rows.end());
  return rows;
}

/// All contacts of one pair, list by list, in the reported order.
struct Rows {
  std::vector<Row> vertexTriangle, triangleVertex, edgeEdge;
  std::vector<ElementPair> intersectingTriangles;
  double earliestTimeOfImpact = std::numeric_limits<double>::infinity();

  Rows() = default;
  explicit Rows(const CollisionData& data) {
    for (const auto& c : data.vertexTriangle()) vertexTriangle.push_back(rowOf<false>(c));
    for (const auto& c : data.triangleVertex()) triangleVertex.push_back(rowOf<true>(c));
    for (const auto& c : data.edgeEdge()) edgeEdge.push_back(rowOf(c));
    const auto pairs = data.intersectingTriangles();
    intersectingTriangles.assign(pairs.begin(), pairs.end());
    earliestTimeOfImpact = data.earliestTimeOfImpact();
  }
  std::size_t contacts() const {
    return vertexTriangle.size() + triangleVertex.size() + edgeEdge.size();
  }
  bool anything() const { return earliestTimeOfImpact <= 1; }
  friend bool operator==(const Rows&, const Rows&) = default;
};

inline std::string firstDifference(const std::vector<Row>& found, const std::vector<Row>& truth) {
  const std::size_t size = std::min(found.size(), truth.size());
  std::size_t i = 0;
  while (i < size && found[i] == truth[i]) ++i;
  if (i == found.size() && i == truth.size()) return {};
  const auto text = [](const std::vector<Row>& rows, std::size_t row) -> std::string {
    if (row >= rows.size()) return " none";
    std::string line;
    for (const std::uint64_t word : rows[row]) {
      char value[40];
      if (word < 1u << 30)
        std::snprintf(value, sizeof value, " %u", static_cast<unsigned>(word));
      else
        std::snprintf(value, sizeof value, " %.17g", std::bit_cast<double>(word));
      line += value;
    }
    return line;
  };
  return "row " + std::to_string(i) + " of " + std::to_string(found.size()) + ":" + text(found, i) +
         "\n  truth, of " + std::to_string(truth.size()) + ":" + text(truth, i);
}

/// Expects equal sets of contacts, bit by bit.
inline void expectSameRows(const Rows& found, const Rows& truth) {
  EXPECT_EQ(firstDifference(found.vertexTriangle, truth.vertexTriangle), "") << "vertexTriangle";
  EXPECT_EQ(firstDifference(found.triangleVertex, truth.triangleVertex), "") << "triangleVertex";
  EXPECT_EQ(firstDifference(found.edgeEdge, truth.edgeEdge), "") << "edgeEdge";
  EXPECT_EQ(found.intersectingTriangles, truth.intersectingTriangles);
  EXPECT_EQ(found.earliestTimeOfImpact, truth.earliestTimeOfImpact);
}

/// Expects equal contacts of every kind, bit by bit, and prints the first that differs.
inline void expectSameContacts(const CollisionData& found, const CollisionData& truth) {
  expectSameRows(Rows(found), Rows(truth));
  const auto expectSameList = [](const auto& l, const auto& r) {
    EXPECT_EQ(l.size(), r.size());
    const auto at = std::mismatch(l.begin(), l.end(), r.begin(), r.end()).first - l.begin();
    EXPECT_TRUE(std::equal(l.begin(), l.end(), r.begin(), r.end())) << "contact " << at;
  };
  expectSameList(found.shape(), truth.shape());
  expectSameList(found.shapeShape(), truth.shapeShape());
}

/// Rows ascend by their first ids, and each row occurs once.
inline bool ascend(const std::vector<Row>& rows, std::size_t idWords) {
  return std::adjacent_find(rows.begin(), rows.end(), [&](const Row& p, const Row& q) {
           return !std::lexicographical_compare(p.begin(), p.begin() + idWords, q.begin(),
                                                q.begin() + idWords);
         }) == rows.end();
}

inline void expectWellFormed(const VertexTriangleContact& c, const Mesh& triangles) {
  EXPECT_EQ(c.vertices, triangles.triangles[c.triangle]);
  EXPECT_NEAR(c.normal.norm(), 1.0, 1e-15);  // a NaN is near nothing
  EXPECT_GE(c.weights.minCoeff(), 0.0);
  EXPECT_EQ(c.weights.sum(), 1.0);
}

inline void expectWellFormed(const EdgeEdgeContact& c) {
  EXPECT_LT(c.edgeA[0], c.edgeA[1]);
  EXPECT_LT(c.edgeB[0], c.edgeB[1]);
  EXPECT_NEAR(c.normal.norm(), 1.0, 1e-15);
  for (const double weight : {c.weightA, c.weightB}) EXPECT_TRUE(weight >= 0 && weight <= 1);
}

/// Expects sorted rows without duplicates, unit normals, valid weights, and times within the step.
inline void expectWellFormed(const CollisionData& data, const Mesh& a, const Mesh& b,
                             const PairSettings& settings) {
  const Rows rows(data);
  EXPECT_TRUE(ascend(rows.vertexTriangle, 2));
  EXPECT_TRUE(ascend(rows.triangleVertex, 2));
  EXPECT_TRUE(ascend(rows.edgeEdge, 4));
  EXPECT_EQ(std::adjacent_find(rows.intersectingTriangles.begin(), rows.intersectingTriangles.end(),
                               [](const auto& p, const auto& q) { return !(p < q); }),
            rows.intersectingTriangles.end());
  const bool proximity = settings.method == Method::Proximity,
             continuous = settings.method == Method::Continuous,
             intersection = settings.method == Method::Intersection;
  const auto expectNumbers = [&](const auto& c) {
    if (!intersection) {
      EXPECT_GE(c.distance, 0.0);
    }
    EXPECT_LE(c.distance, proximity ? settings.thickness : std::numeric_limits<double>::infinity());
    EXPECT_GE(c.timeOfImpact, continuous ? 0.0 : 1.0);
    EXPECT_LE(c.timeOfImpact, 1.0);
  };
  for (const auto& c : data.vertexTriangle()) {
    expectNumbers(c);
    expectWellFormed(c, b);
  }
  for (const auto& c : data.triangleVertex()) {
    expectNumbers(c);
    expectWellFormed(c, a);
  }
  for (const auto& c : data.edgeEdge()) {
    expectNumbers(c);
    expectWellFormed(c);
  }
}

/// Named settings of one pair.
struct MethodCase {
  std::string name;
  PairSettings settings;
  friend void PrintTo(const MethodCase& method, std::ostream* out) { *out << method.name; }
};

/// Every method and every choice of contacts. The thickness applies where the method has one.
inline std::vector<MethodCase> methodCases(double thickness) {
  return {{"ProximityDistinct", {Method::Proximity, thickness, Contacts::Distinct}},
          {"ProximityAll", {Method::Proximity, thickness, Contacts::All}},
          {"Intersection", {Method::Intersection, 0, Contacts::All}},
          {"Continuous", {Method::Continuous, 0, Contacts::All}},
          {"ContinuousWithThickness", {Method::Continuous, thickness, Contacts::All}},
          {"ContinuousEarliest",
           {.method = Method::Continuous, .continuous = {.earliestTimeOnly = true}}}};
}

}  // namespace palpate::testing
