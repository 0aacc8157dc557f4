#pragma once

#include <palpate/Capture.h>

#include "Shapes/Shape.h"
#include "Fields/Description.h"
#include "Fields/Problem.h"
#include "Core/Archive.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <type_traits>
#include <utility>

/// What a CollisionProblem consists of, for captures and for saved states. Each function writes a
/// part to a file or reads it: `file` is a writer or a reader of either, of which File::kReads says
/// whether it reads.
namespace palpate::description {

inline constexpr int kVersion = 14;  ///< of captures

// Enumerators are written by name.
inline constexpr std::array<std::string_view, 6> kShapes{"Sphere", "Capsule",  "Plane",
                                                         "Box",    "Cylinder", "ConvexHull"};
// Before version 9, a third value of `contacts` stood for earliestTimeOnly.
enum class ContactsBefore9 { Distinct, All, Earliest };

template <class File, class SettingsType>
void settingsLine(File& file, SettingsType& settings, int version) {
  file.word(settings.engine, kEnumerators<Engine>);
  file.integer(settings.threads);
  file.integer(settings.octree.maxDepth);
  file.integer(settings.octree.maxElementsPerLeaf);
  file.word(settings.octree.update, kEnumerators<OctreeUpdate>);
  if (version >= 10) file.word(settings.octree.bounds, kEnumerators<OctreeBounds>);
}

// Least numbers of characters of items: a digit and a space for each number.
inline constexpr std::size_t kNumberText = 2, kPointText = 3 * kNumberText,
                             kVertexText = 2 * kPointText, kTriangleText = 3 * kNumberText,
                             kTetrahedronText = 4 * kNumberText,
                             kGeometryText = std::string_view("geometry 0 0 0 ").size(),
                             kPairText = std::string_view("pair 0 0 Auto Auto 0 All ").size(),
                             kSideText = std::string_view("EdgeEdge 0 0 0 0 0 ").size();

template <class File>
void listOf(File& file, auto& list) {
  sizeOf(file, list, kNumberText);
  fieldOf(file, list);
}

template <class File, class SettingsType>
void contactsOf(File& file, SettingsType& settings, int version) {
  if (version >= 9) return file.word(settings.contacts, kEnumerators<Contacts>);
  if constexpr (File::kReads) {
    ContactsBefore9 contacts{};
    file.word(contacts, kEnumerators<ContactsBefore9>);
    settings.continuous.earliestTimeOnly = contacts == ContactsBefore9::Earliest;
    settings.contacts = contacts == ContactsBefore9::All ? Contacts::All : PairSettings().contacts;
  }
}

template <class File, class PairType>
void pairLine(File& file, PairType& pair, int version) {
  if constexpr (kIsArchive<File>) return valueOf(file, pair);
  file.integer(pair.a);
  file.integer(pair.b);
  file.word(pair.settings.method, kEnumerators<Method>);
  file.word(pair.method, kEnumerators<Method>);
  file.real(pair.settings.thickness);
  contactsOf(file, pair.settings, version);
  if (version >= 2) file.real(pair.settings.automatic.motionTolerance);
  if (version >= 3) file.real(pair.settings.restDistance);
  if (version >= 4) fieldOf(file, pair.predicate);
  if (version >= 6) file.real(pair.settings.continuous.timeTolerance);
  if (version >= 9) fieldOf(file, pair.settings.continuous.earliestTimeOnly);
  if (version >= 11) file.real(pair.settings.allowedError);
  if (version >= 11) file.real(pair.settings.proxy.widestNormalCone);
  if (version >= 12) file.real(pair.settings.freeMotionReach);
  if (version >= 13) fieldOf(file, pair.settings.trackContacts);
  if (version >= 13) fieldOf(file, pair.settings.reportCrossings);
  if (version < 14) return;
  file.integer(pair.settings.priority);
  fieldOf(file, pair.settings.smoothNormals);
  fieldOf(file, pair.settings.rememberSides);
  sizeOf(file, pair.sides, kSideText);
  for (auto& side : pair.sides) {
    file.word(side.kind, kEnumerators<ContactFeatures::Kind>);
    fieldOf(file, side.ids);
    fieldOf(file, side.forward);
  }
}

template <class File, class FilterType>
void filterOf(File& file, FilterType& filter) {
  file.integer(filter.groups);
  file.integer(filter.mask);
  file.word(filter.sidedness, kEnumerators<Sidedness>);
}

/// A shape's dimensions, and its placements at both ends of the step.
template <class File, class MeshType>
void shapeOf(File& file, MeshType& mesh, int version) {
  forEachField(*mesh.analytical, [&](std::string_view, auto& field) {
    if constexpr (requires { field.capacity(); }) sizeOf(file, field, kPointText);
    fieldOf(file, field);
  });
  const auto poseOf = [&](auto& pose) {
    for (int k = 0; k < 3; ++k) {
      for (int i = 0; i < 3; ++i) fieldOf(file, pose.rotation(k, i));
      fieldOf(file, pose.translation[k]);
    }
  };
  poseOf(mesh.motion.now);
  if (version >= 7) return poseOf(mesh.motion.before);
  if constexpr (File::kReads) mesh.motion.before = mesh.motion.now;
}

/// A shape of the type with this index.
template <std::size_t... indices>
AnalyticalGeometry shapeOfType(std::size_t index, std::index_sequence<indices...>) {
  AnalyticalGeometry shape;
  (void)((index == indices && (shape.emplace<indices>(), true)) || ...);
  return shape;
}

template <class File, class MeshType>
void meshLines(File& file, MeshType& mesh, int version) {
  file.expect("geometry");
  auto id = static_cast<std::uint32_t>(mesh.id);
  file.integer(id);
  sizeOf(file, mesh.now, kVertexText);
  sizeOf(file, mesh.triangles, kTriangleText);
  if (version >= 3) {
    file.word(mesh.type, kEnumerators<GeometryType>);
    listOf(file, mesh.radii);
    if (mesh.type == GeometryType::Shape) {
      std::size_t index = mesh.analytical ? mesh.analytical->index() : 0;
      file.word(index, kShapes);
      if constexpr (File::kReads)
        mesh.analytical = shapeOfType(index, std::make_index_sequence<kShapes.size()>());
      shapeOf(file, mesh, version);
    }
  }
  std::size_t rest = File::kReads ? mesh.type == GeometryType::Lines : mesh.rest.size();
  if (version >= 4) {
    filterOf(file, mesh.filter);
    listOf(file, mesh.disabled);
    file.count(rest, kNumberText);
  }
  if (version >= 8) sizeOf(file, mesh.tetrahedra, kTetrahedronText);
  if (version >= 14)
    for (auto* list : {&mesh.tags, &mesh.removed, &mesh.removedTetrahedra}) listOf(file, *list);
  file.endLine();
  if constexpr (File::kReads) {
    mesh.id = GeometryId{id};
    mesh.before.resize(mesh.now.size());
    mesh.rest.resize(rest ? mesh.now.size() : 0);
  }
  for (std::size_t v = 0; v < mesh.now.size(); ++v) {
    fieldOf(file, mesh.before.at(v));
    fieldOf(file, mesh.now[v]);
    if (rest) fieldOf(file, mesh.rest.at(v));
    file.endLine();
  }
  const auto elements = [&](auto& list) {
    for (auto& element : list) {
      fieldOf(file, element);
      file.endLine();
    }
  };
  elements(mesh.triangles);
  elements(mesh.tetrahedra);
}

/// All lines except the title.
template <class File, class ProblemType>
void problemLines(File& file, ProblemType& problem, int version) {
  settingsLine(file, problem.settings, version);
  file.endLine();
  sizeOf(file, problem.geometries, kGeometryText);
  sizeOf(file, problem.pairs, kPairText);
  file.endLine();
  for (auto& mesh : problem.geometries) meshLines(file, mesh, version);
  for (auto& pair : problem.pairs) {
    file.expect("pair");
    pairLine(file, pair, version);
    file.endLine();
  }
  file.expect("end");
  file.endLine();
}

}  // namespace palpate::description
