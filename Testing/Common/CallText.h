#pragma once

#include <palpate/AnalyticalGeometry.h>
#include <palpate/StepGuard.h>
#include <palpate/Types.h>

#include "Fields/Names.h"
#include "Fields/Settings.h"
#include "Fields/Shapes.h"

#include <array>
#include <cstdint>
#include <cstdio>
#include <string>
#include <type_traits>
#include <variant>
#include <vector>

/// Arguments of calls as C++: a list of calls is then the body of a program.
namespace palpate::testing {

inline std::string textOf(bool value) { return value ? "true" : "false"; }
inline std::string textOf(double value) {
  std::array<char, 40> text{};
  std::snprintf(text.data(), text.size(), "%.17g", value);
  return text.data();
}
template <class Value>
requires std::is_integral_v<Value> std::string textOf(Value value) { return std::to_string(value); }
template <class Value>
requires std::is_enum_v<Value> std::string textOf(Value value) {
  const std::string type(nameOfType<Value>());
  return type + "::" + nameOfEnumerator(value);
}
inline std::string textOf(GeometryId id) {
  return "GeometryId{" + std::to_string(static_cast<std::uint32_t>(id)) + "}";
}
inline std::string textOf(const std::string& value) { return '"' + value + '"'; }

// Each of these may hold others.
std::string textOf(const Eigen::Vector3d&);
std::string textOf(const std::vector<Eigen::Vector3d>&);
std::string textOf(const Pose&);
std::string textOf(const AnalyticalGeometry&);
template <class Value, std::size_t count>
std::string textOf(const std::array<Value, count>&);
template <HasFields Struct>
std::string textOf(const Struct&);

template <class Range>
std::string listText(const Range& values) {
  std::string text = "{";
  for (const auto& value : values) text += (text.size() > 1 ? ", " : "") + textOf(value);
  return text + "}";
}
inline std::string textOf(const Eigen::Vector3d& p) { return listText(p); }
template <class Value, std::size_t count>
std::string textOf(const std::array<Value, count>& values) {
  return listText(values);
}

/// Members that differ from the defaults, by their names.
template <HasFields Struct>
std::string textOf(const Struct& value) {
  const Struct defaults{};
  std::string text;
  forEachMember(value, [&](const auto& field, const auto& member) {
    if constexpr (requires { textOf(member); }) {
      const std::string own = textOf(member);
      if (own != textOf(defaults.*field.member))
        text += (text.empty() ? "." : ", .") + std::string(field.name) + " = " + own;
    }
  });
  return "{" + text + "}";
}

// A span of elements, as an initializer of the named vector type.
inline std::string textOf(const std::vector<Eigen::Vector3d>& v) {
  return "Positions" + listText(v);
}
inline std::string textOf(const std::vector<Triangle>& v) { return "Triangles" + listText(v); }
inline std::string textOf(const std::vector<Tetrahedron>& v) { return "Tetrahedra" + listText(v); }
inline std::string textOf(const std::vector<Segment>& v) { return "Segments" + listText(v); }
inline std::string textOf(const std::vector<double>& v) { return "Radii" + listText(v); }
inline std::string textOf(const std::vector<std::uint32_t>& v) { return "Ids" + listText(v); }
inline std::string textOf(const std::vector<Crossing>& sides) {
  std::string text = "Sides{";
  for (const Crossing& side : sides)
    text += (side == sides.front() ? "{" : ", {") + textOf(side.kind) + ", " + textOf(side.ids) +
            ", 0, " + textOf(side.forward) + "}";
  return text + "}";
}
inline std::string textOf(const Pose& pose) {
  std::string text = "poseOf({";
  for (int i = 0; i < 9; ++i) text += (i ? ", " : "") + textOf(pose.rotation(i / 3, i % 3));
  return text + "}, " + textOf(pose.translation) + ")";
}
inline std::string textOf(const AnalyticalGeometry& shape) {
  return std::visit(
      [](const auto& s) {
        return std::string(nameOfType<std::decay_t<decltype(s)>>()) + textOf(s);
      },
      shape);
}

template <class... Arguments>
std::string argumentsText(const Arguments&... arguments) {
  std::string text;
  ((text += (text.empty() ? "" : ", ") + textOf(arguments)), ...);
  return text;
}

}  // namespace palpate::testing
