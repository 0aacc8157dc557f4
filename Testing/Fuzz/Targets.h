#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

/// What is fuzzed: functions that take any bytes. A fault is a crash, an exception or a failure of
/// GoogleTest.
namespace palpate::fuzz {

using Bytes = std::span<const std::uint8_t>;

void objFile(Bytes);
void stlFile(Bytes);
void plyFile(Bytes);
void vtkFile(Bytes);
void vtpFile(Bytes);
void vtuFile(Bytes);
void gmshFile(Bytes);
void meditFile(Bytes);
void captureFile(Bytes);
void fieldFile(Bytes);
void distance(Bytes);
void intersection(Bytes);
void timeOfImpact(Bytes);
void history(Bytes);

struct Target {
  std::string_view name;  ///< also of its folder in Data/Fuzz
  void (*run)(Bytes);
};

inline constexpr std::array kTargets{Target{"Obj", objFile},
                                     Target{"Stl", stlFile},
                                     Target{"Ply", plyFile},
                                     Target{"Vtk", vtkFile},
                                     Target{"Vtp", vtpFile},
                                     Target{"Vtu", vtuFile},
                                     Target{"Gmsh", gmshFile},
                                     Target{"Medit", meditFile},
                                     Target{"Capture", captureFile},
                                     Target{"Field", fieldFile},
                                     Target{"Distance", distance},
                                     Target{"Intersection", intersection},
                                     Target{"TimeOfImpact", timeOfImpact},
                                     Target{"History", history}};

}  // namespace palpate::fuzz
