#pragma once

#include "Python/Members.h"
#include "Fields/Contacts.h"
#include "Fields/Names.h"
#include "Fields/Queries.h"
#include "Fields/Settings.h"
#include "Fields/Shapes.h"
#include "Fields/Statistics.h"

#include <palpate/Capture.h>
#include <palpate/PenetrationTracker.h>

#include <functional>

namespace palpate::python {

/// Settings, statistics and shapes, of which Python has classes with the same values.
template <class T, class... Structs>
inline constexpr bool kIsOneOf = (std::is_same_v<T, Structs> || ...);
template <class T>
inline constexpr bool kIsStructWithClass =
    kIsOneOf<T, OctreeSettings, AuditSettings, Settings, PairSettings, SurfaceProxySettings,
             CollisionFilter, InsideSettings, MemoryUse, FrameStatistics::Stages, UnfinishedPair,
             FrameStatistics, PairStatistics, OctreeStatistics, Validity, Sphere, Capsule, Plane,
             Box, Cylinder, ConvexHull>;

/// Whether the package palpate has a class for the struct or the enumeration.
template <class T>
constexpr bool hasClass() {
  if constexpr (std::is_enum_v<T>)
    return !nameOfType<T>().empty() && !kEnumerators<T>.empty();
  else
    return kIsStructWithClass<T>;
}
template <class T>
concept HasClass = hasClass<T>();

/// The name of the class: that of C++ without colons.
template <HasClass T>
inline constexpr auto kClass = [] {
  std::array<char, nameOfType<T>().size() + 1> name{};
  std::copy_if(nameOfType<T>().begin(), nameOfType<T>().end(), name.begin(),
               [](char letter) { return letter != ':'; });
  return name;
}();
template <>
inline constexpr std::array kClass<FrameStatistics::Stages> = std::to_array("FrameStages");

/// Calls function(name, member) for each attribute of the class of a struct. Those of a struct that
/// has no class, such as ContinuousSettings, stand in its place.
template <class Struct, class Function>
void forEachAttribute(Struct& object, const Function& function) {
  forEachMember(object, [&](const auto& field, auto& member) {
    using Member = std::remove_cvref_t<decltype(member)>;
    if constexpr (HasFields<Member> && !HasClass<Member>)
      forEachAttribute(member, function);
    else
      function(snakeCase(field.name).text, member);
  });
}

/// The class of a struct or an enumeration.
template <HasClass T>
py::handle classOf() {
  return lookedUp<T>("palpate", kClass<T>.data());
}

/// Tags of lookedUp().
struct ParseFunction;
struct ReplaceFunction;

/// Converts what pybind11 cannot by itself.
template <class T>
py::object toPython(const T& value) {
  if constexpr (std::is_same_v<T, Eigen::Vector3d> ||
                std::is_same_v<T, std::vector<Eigen::Vector3d>>)
    return copyOf(value);
  else
    return py::cast(value);
}
template <class T>
T fromPython(const py::handle& value, const char* name) {
  if constexpr (std::is_same_v<T, Eigen::Vector3d>) {
    return position(value, name);
  } else if constexpr (std::is_same_v<T, std::vector<Eigen::Vector3d>>) {
    const Positions positions(value, name);
    return {positions.span().begin(), positions.span().end()};
  } else if constexpr (std::is_same_v<T, std::filesystem::path>) {
    return value.cast<std::string>();
  } else if constexpr (std::is_arithmetic_v<T> && !std::is_same_v<T, bool>) {
    try {
      return value.cast<T>();
    } catch (const py::cast_error&) {
      if (!PyNumber_Check(value.ptr()))
        throw py::type_error(std::string(name) + " must be a number, not " +
                             py::repr(value).cast<std::string>());
      throw Error(ErrorCode::InvalidSettings, std::string(name) + " is " +
                                                  py::repr(value).cast<std::string>() +
                                                  ", which is no valid value.");
    }
  } else {
    return value.cast<T>();
  }
}

/// Poses of Python and of the library.
Pose poseOf(const py::handle& pose);
py::object toPython(const Pose& pose);
/// None is a body that was never placed.
RigidMotion motionOf(const py::handle& motion);
py::object toPython(const RigidMotion& motion);
AnalyticalGeometry shapeOf(const py::handle& shape);
py::object toPython(const AnalyticalGeometry& shape);

/// `settings` of the caller, or the default for None, with the given keywords changed.
template <HasClass T>
T settingsOf(const py::handle& settings, const py::dict& keywords) {
  if (settings.is_none()) return classOf<T>()(**keywords).template cast<T>();
  if (keywords.empty()) return settings.cast<T>();
  return lookedUp<ReplaceFunction>("dataclasses", "replace")(settings, **keywords)
      .template cast<T>();
}

}  // namespace palpate::python

namespace pybind11::detail {

/// Enumerations: a member of the class, its name, or its number.
template <class T>
struct type_caster<T, std::enable_if_t<std::is_enum_v<T> && palpate::python::HasClass<T>>> {
  PYBIND11_TYPE_CASTER(T, const_name("int"));
  bool load(handle source, bool) {
    const object member = palpate::python::lookedUp<palpate::python::ParseFunction>(
        "palpate._enums", "parse")(palpate::python::classOf<T>(), source);
    value = static_cast<T>(member.cast<int>());
    return true;
  }
  static handle cast(T source, return_value_policy, handle) {
    return palpate::python::classOf<T>()(static_cast<int>(source)).release();
  }
};

/// Structs: an object with the attributes of the dataclass.
template <class T>
struct type_caster<T, std::enable_if_t<std::is_class_v<T> && palpate::python::HasClass<T>>> {
  PYBIND11_TYPE_CASTER(T, const_name("object"));
  bool load(handle source, bool) {
    if (!isinstance(source, palpate::python::classOf<T>())) return false;
    palpate::python::forEachAttribute(value, [&](const char* field, auto& member) {
      using Member = std::remove_cvref_t<decltype(member)>;
      member = palpate::python::fromPython<Member>(source.attr(field), field);
    });
    return true;
  }
  static handle cast(const T& source, return_value_policy, handle) {
    dict values;
    palpate::python::forEachAttribute(source, [&](const char* field, const auto& member) {
      values[field] = palpate::python::toPython(member);
    });
    return palpate::python::classOf<T>()(**values).release();
  }
};

template <>
struct type_caster<palpate::GeometryId> {
  PYBIND11_TYPE_CASTER(palpate::GeometryId, const_name("int"));
  bool load(handle source, bool) {
    value = palpate::python::geometryId(source);
    return true;
  }
  static handle cast(palpate::GeometryId id, return_value_policy, handle) {
    return int_(static_cast<std::uint32_t>(id)).release();
  }
};

template <>
struct type_caster<std::filesystem::path> {
  PYBIND11_TYPE_CASTER(std::filesystem::path, const_name("str"));
  bool load(handle source, bool) {
    const auto text = reinterpret_steal<object>(PyOS_FSPath(source.ptr()));
    if (!text) throw error_already_set();
    value = text.cast<std::string>();
    return true;
  }
  static handle cast(const std::filesystem::path& source, return_value_policy, handle) {
    return pybind11::str(source.string()).release();
  }
};

}  // namespace pybind11::detail
