#pragma once

#include <palpate/CollisionData.h>

#include "Contact/ContactLists.h"
#include "Core/Buffer.h"
#include "Core/CountedVector.h"
#include "Core/MemoryBudget.h"

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>

namespace palpate {

struct PairRecord;

/// What a CollisionData holds.
struct CollisionData::Contents : CountedObject {
  CountedVector<VertexTriangleContact> vertexTriangle, triangleVertex;
  CountedVector<EdgeEdgeContact> edgeEdge;
  CountedVector<ElementPair> intersectingTriangles;
  CountedVector<ShapeContact> shape;
  CountedVector<ShapeShapeContact> shapeShape;
  double earliestTimeOfImpact = std::numeric_limits<double>::infinity();
  double errorBound = 0.0;
  Validity validity;
  /// What is known about each contact of a list. A column is empty, or parallel to the list.
  struct Columns {
    CountedVector<TrackedContact> tracked{};  ///< PairSettings::trackContacts
    CountedVector<ContactTags> tags{};        ///< OctreeBasedCD::setTags()
    CountedVector<Eigen::Vector3d> smooth{};  ///< PairSettings::smoothNormals; none of two shapes
  };
  std::array<Columns, 5> columns{};  ///< by ContactKind
  Columns& columnsOf(ContactKind kind) { return columns[static_cast<std::size_t>(kind)]; }
  const Columns& columnsOf(ContactKind kind) const {
    return columns[static_cast<std::size_t>(kind)];
  }
  /// Gives back memory beyond the sizes of the lists and columns.
  void releaseSpare() {
    forEachContactList(*this, [](ContactKind, auto& list) { palpate::releaseSpare(list); });
    for (auto& [tracked, tags, smooth] : columns) {
      palpate::releaseSpare(tracked);
      palpate::releaseSpare(tags);
      palpate::releaseSpare(smooth);
    }
    for (auto* list : {&crossings, &rememberedSides}) palpate::releaseSpare(*list);
    palpate::releaseSpare(intersectingTriangles);
    palpate::releaseSpare(ended);
  }
  /// Empties a column of all lists, and gives its memory back.
  template <class T>
  void drop(CountedVector<T> Columns::*column) {
    for (Columns& each : columns) CountedVector<T>().swap(each.*column);
  }
  CountedVector<TrackedContact> ended{};
  bool trackedOfSecond = false;  ///< tracked contacts with shapes are of the second geometry
  CountedVector<Crossing> crossings{};
  CountedVector<Crossing> rememberedSides{};
  /// What CollisionData::appendRows() needs beside the contacts.
  struct Step {
    const PairRecord* record = nullptr;  ///< whose answer this is; null: a copy, or Parts
    bool elementsOfSecond = false;       ///< shape() has elements of the pair's second geometry
    /// L: the largest sum of the radii at a contact. Infinity: it is not known.
    double radii = std::numeric_limits<double>::infinity();
    double timeTolerance = 0.0;
    /// Of a copy: the offset of each row, if the step was not over.
    bool hasOffsets = false;
    CountedVector<double> offsets{};
    /// The row of an impact at the step's end (EndRows).
    struct EndRow {
      std::uint32_t contact = 0;  ///< the number of the impact among contacts between meshes
      Stencil stencil{};          ///< with vertices on the sides that the contact's vertices have
      Eigen::Vector3d normal{};   ///< unit, not smooth
      double gap = 0.0;           ///< L: at the step's end
    };
    CountedVector<EndRow> endRows{};  ///< ascending; of other contacts the row is at their time
  } step{};

  static bool isIn(const CollisionData& data) { return data.m_contents != nullptr; }
  /// Without contacts if `data` has none.
  static const Contents& read(const CollisionData& data) { return data.read(); }
  /// Makes them if `data` has none.
  static Contents& of(CollisionData& data) {
    if (!data.m_contents) data.m_contents = std::make_unique<Contents>();
    return *data.m_contents;
  }
};

}  // namespace palpate
