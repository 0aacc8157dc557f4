// Prints the members of the public structs and the names of enumerators, as Source/Fields has them:
// one JSON object, which mirrors.py reads.
#include "Fields/Contacts.h"
#include "Fields/Names.h"
#include "Fields/FeaturePairs.h"
#include "Fields/Queries.h"
#include "Fields/Rows.h"
#include "Fields/Settings.h"
#include "Fields/Statistics.h"
#include "Fields/Topology.h"

#include <palpate/Capture.h>

#include <filesystem>
#include <iostream>
#include <sstream>
#include <string>

namespace palpate {
namespace {

template <class T>
struct Type {
  static std::string text() {
    if constexpr (std::is_same_v<T, bool>)
      return "bool";
    else if constexpr (std::is_same_v<T, double>)
      return "double";
    else if constexpr (std::is_integral_v<T>)
      return (std::is_signed_v<T> ? "int" : "uint") + std::to_string(8 * sizeof(T));
    else if constexpr (std::is_enum_v<T>)
      return "enum " + Type<std::underlying_type_t<T>>::text() + " " + std::string(nameOfType<T>());
    else if constexpr (HasFields<T>)
      return "struct " + std::string(nameOfType<T>());
    else
      return "other";
  }
};
template <>
struct Type<Eigen::Vector3d> {
  static std::string text() { return "double[3]"; }
};
template <>
struct Type<std::filesystem::path> {
  static std::string text() { return "path"; }
};
template <class T, std::size_t N>
struct Type<std::array<T, N>> {
  static std::string text() { return Type<T>::text() + "[" + std::to_string(N) + "]"; }
};
template <class T>
struct Type<std::vector<T>> {
  static std::string text() { return "list " + Type<T>::text(); }
};

std::string defaultOf(const auto& value) {
  using Value = std::remove_cvref_t<decltype(value)>;
  std::ostringstream out;
  if constexpr (std::is_enum_v<Value>)
    out << nameOfEnumerator(value);
  else if constexpr (std::is_arithmetic_v<Value>)
    out << std::boolalpha << value;
  return out.str();
}

const char* separator = "";

template <class Struct>
void printStruct() {
  const Struct object{};
  std::cout << separator << "\"" << nameOfType<Struct>() << "\": [";
  separator = "";
  forEachMember(object, [&](const auto& field, const auto& member) {
    using Member = std::remove_cvref_t<decltype(member)>;
    std::cout << separator << "{\"name\": \"" << field.name << "\", \"type\": \""
              << Type<Member>::text() << "\", \"unit\": \"" << nameOfEnumerator(field.unit)
              << "\", \"default\": \"" << defaultOf(member) << "\", \"inC\": "
              << (std::remove_cvref_t<decltype(field)>::kIsInC ? "true" : "false") << "}";
    separator = ",\n  ";
  });
  std::cout << "]";
  separator = ",\n";
}

template <class Enumeration>
void printEnumeration() {
  std::cout << separator << "\"" << nameOfType<Enumeration>() << "\": [";
  separator = "";
  for (const std::string_view name : kEnumerators<Enumeration>) {
    std::cout << separator << "\"" << name << "\"";
    separator = ", ";
  }
  std::cout << "]";
  separator = ",\n";
}

template <class... Structs>
void printStructs() {
  (printStruct<Structs>(), ...);
}
template <class... Enumerations>
void printEnumerations() {
  (printEnumeration<Enumerations>(), ...);
}

void print() {
  std::cout << "{\"structs\": {\n";
  printStructs<OctreeSettings, AuditSettings, Settings, ContinuousSettings, AutoSettings,
               LeafSettings, PairSettings, SurfaceProxySettings, CollisionFilter, ContactFeatures,
               InsideSettings, ElementPair, VertexTriangleContact, EdgeEdgeContact, ShapeContact,
               ShapeShapeContact, ContactKey, Crossing, Validity, ThreadEvent, MemoryUse,
               UnfinishedPair, FrameStatistics::Stages, FrameStatistics, PairStatistics,
               OctreeStatistics, ConstraintRow, ContactMotion, SurfacePoint, SignedDistance, Ray,
               RayHit, Pick, GeometryDistance, Penetration, PathInterval, PathClearance,
               InsideVertex, TetrahedronPoint, EmbeddedVertex>();
  std::cout << "},\n\"enumerations\": {\n";
  separator = "";
  printEnumerations<GeometryType, OctreeUpdate, OctreeBounds, Engine, Method, Contacts, Sidedness,
                    ContactKind, ContactEnd, ThreadEvent::Cause, ContactFeatures::Kind,
                    ShapeElement, TriangleFeature, EdgeFeature, ErrorCode, AuditFailure::Fault,
                    AuditFailure::List, MethodReason, InsideRule, DirectionChange,
                    LooseOctree::Update>();
  std::cout << "}}\n";
}

}  // namespace
}  // namespace palpate

int main() { palpate::print(); }
