#!/bin/bash
# testChecks.sh ROOT COMPILER EIGEN: plants faults, one at a time, in a copy of the tree. check.sh must find each of them.
set -uo pipefail
root=$1 compiler=$2 eigen=$3
check=$root/Testing/Conventions/check.sh
tree=$(mktemp -d)
trap 'rm -rf "$tree"' EXIT
missed=0

# A tree with every module, without faults.
for module in Core Math Mesh Shapes Contact Octree NarrowPhase CollisionDetection Diagnostics Adapters/MeshFiles Adapters/Vtk Adapters/Fcl Adapters/iMSTK \
  Public/palpate Adapters/Vtk/Public/palpate/vtk; do
  mkdir -p "$tree/Source/$module"
done
mkdir -p "$tree/Examples" "$tree/Testing"
cp "$root/.clang-format" "$root/.clang-tidy" "$tree"
printf '#pragma once\n\n#include <array>\n' >"$tree/Source/Public/palpate/Types.h"
printf '#pragma once\n' >"$tree/Source/Public/palpate/Capture.h"

# expect STATUS CHECK ARGUMENT...
expect() {
  local expected=$1 check_=$2 output
  shift 2
  output=$(bash "$check" "$check_" "$tree" "$@" 2>&1)
  [[ $? -ne 0 ]] && set -- fails || set -- holds
  [[ $1 == "$expected" ]] || { echo "$check_ should say: $expected. $planted"; echo "$output"; missed=1; }
}
# plant CHECK FILE TEXT [ARGUMENT...]: CHECK holds without FILE and fails with it.
declare -A held=()  # what was seen to hold for the tree as it is
plant() {
  local check_=$1 file=$tree/$2 text=$3
  planted="$2: $text"
  shift 3
  [[ -n ${held["$check_ $*"]-} ]] || expect holds "$check_" "$@"
  held["$check_ $*"]=1
  printf "$text" >"$file"
  expect fails "$check_" "$@"
  rm "$file"
}

plant Includes Source/Core/A.h '#include "Octree/Pool.h"\n'
plant Includes Source/Core/A.h '#include <palpate/OctreeBasedCD.h>\n'
plant Includes Source/Math/A.h '#  include "Mesh/TriangleMesh.h"\n'
plant Includes Source/Octree/A.cpp '#include "Mesh/TriangleMesh.h"\n'
plant Includes Source/NarrowPhase/A.h '#include "Octree/Pool.h"\n'
plant Includes Source/Mesh/A.h '#include "Shapes/Shape.h"\n'
plant Includes Source/Shapes/A.h '#include "NarrowPhase/NarrowPhase.h"\n'
plant Includes Source/Contact/A.h '#include "NarrowPhase/NarrowPhase.h"\n'
plant Includes Source/Diagnostics/A.h '#include "Contact/FirstImpacts.h"\n'
plant Includes Source/Adapters/MeshFiles/A.cpp '#include "Core/Buffer.h"\n'
plant Includes Source/Adapters/Vtk/A.cpp '#include "Core/Buffer.h"\n'
plant Includes Source/Adapters/iMSTK/A.cpp '#include "Core/Buffer.h"\n'
plant Includes Source/Public/palpate/A.h '#include "Core/Buffer.h"\n'
plant Places Source/Mesh/A.cpp '#include <tbb/parallel_for.h>\n'
plant Places Source/Mesh/A.cpp '#include <thread>\n'
plant Places Source/Octree/A.cpp '#include <hwy/highway.h>\n'
plant Places Source/Octree/A.cpp '#include <immintrin.h>\n'
plant Places Source/CollisionDetection/A.cpp '#include <gmp.h>\n'
plant Places Source/CollisionDetection/A.cpp '#include <vtkPolyData.h>\n'
plant Places Source/Adapters/Vtk/A.cpp '#include <fcl/fcl.h>\n'
plant Places Source/Adapters/Vtk/A.cpp '#include <imstkScene.h>\n'
plant Places Source/Math/A.cpp '#include <Eigen/Dense>\n'
plant PublicHeaders Source/Public/palpate/A.h '#pragma once\nstd::size_t a();\n' "$compiler" "$eigen"
plant PublicHeaders Source/Public/palpate/A.h '#pragma once\n#include <Eigen/LU>\n' "$compiler" "$eigen"
plant PublicHeaders Source/Public/palpate/A.h '#define LIBRARY <sys/mman.h>\n#include LIBRARY\n' "$compiler" "$eigen"
plant PublicHeaders Source/Adapters/Vtk/Public/palpate/vtk/A.h '#pragma once\n#include <vtkPolyData.h>\n' "$compiler" "$eigen"
plant PublicHeaders Source/Public/palpate/Palpate.h '#pragma once\n' "$compiler" "$eigen"
plant PublicHeaders Source/Public/palpate/OctreeBasedCD.h '#pragma once\n#include <palpate/Capture.h>\n' "$compiler" "$eigen"
plant PublicHeaders Source/Public/palpate/palpate_c.h '#pragma once\n#include <palpate/Export.h>\n#include <stddef.h>\n#include <stdint.h>\nstruct a; a* f();\n' "$compiler" "$eigen"
plant PublicHeaders Source/Public/palpate/palpate_c.h '#pragma once\n#include <palpate/Types.h>\n' "$compiler" "$eigen"
plant Assertions Source/Math/A.cpp 'int a;\n'
printf '#pragma once\ninline int one() { return 1; }\n' >"$tree/Source/Math/One.h"
held=()
plant Headers Source/Shapes/A.h '#pragma once\ninline int one() { return 2; }\n' "$compiler" "$eigen"
plant Format Source/Core/A.h '#pragma once\nint  a;\n'
plant Format Source/A.md '<<<<<<< HEAD\n'
mkdir -p "$tree/stub/Eigen"  # clang-tidy takes 6 s for the real one
touch "$tree/stub/Eigen/Core"
printf 'namespace palpate {\nint two() { return 2; }\n}\n' >"$tree/Source/Math/Two.cpp"
plant Names Source/Math/A.h '#pragma once\nstruct Two { int m_second; };\n' "$tree/stub" headers
plant Names Source/Math/A.h '#pragma once\ntemplate <int Count>\nvoid repeat();\n' "$tree/stub" headers
plant Names Source/Math/A.cpp 'int Twice(int a) { return 2 * a; }\n' "$tree/stub" Math
plant Names Source/Math/A.cpp '// #include "Core/Simd.h"\nint twice(int first_number) { return 2 * first_number; }\n' "$tree/stub" Math
plant Names Source/Math/A.cpp 'int twice(int a) { return b; }\n' "$tree/stub" Math
rm -r "$tree/stub" "$tree/Source/Math/Two.cpp"
plant Quiet Source/Math/A.cpp 'void f() { std::cerr << 1; }\n'
plant Quiet Source/Math/A.cpp 'void f() { std::printf("1"); }\n'
plant Quiet Source/Math/A.cpp 'void f() { std::exit(1); }\n'
plant Enumerations Source/Public/palpate/A.h 'enum class Side { Left, Right };\n'
plant Enumerations Source/Core/A.cpp '    case Side::Left:\n      return "Right";\n'
plant Parts Source/Math/A.cpp '// Part of Math/Missing.h: f().\n'
plant Parts Source/Math/A.cpp '#include "Math/Box.h"\n'
plant Words Source/Core/A.h 'class PoolManager;\n'
plant Words Source/Mesh/A.cpp 'double a = v.stableNorm();\n'
plant Words Source/Core/A.h 'int data2;\n'
plant Words Source/Core/IndexUtils.h '\n'
plant Threads Source/Math/A.h '#include "Core/Threads.h"\n' NarrowPhase Math
plant Threads Source/Math/A.cpp '#include <thread>\n' Math

for draws in 'f(random(), random());' 'Vector3d p(uniform(random, 0, 1), uniform(random, 0, 1), 0);' \
  'x = uniform(random, 0, 1) * randomPoint(random);' 'const auto next = [&] { return random(); }; f(next(), next());' \
  'if (random.below(2) < random.below(3)) f();'; do
  plant Draws Testing/A.cpp "void g(Random& random) { $draws }\n"
done
planted="draws in an order"
printf '%s\n' 'void g(Random& random) {' '  const Vector3d p{uniform(random, 0, 1), uniform(random, 0, 1), 0};' \
  '  const double x = random(), y = random();' '  f(random, x, random());' \
  '  y = random() % 2 && random() % 3 ? random() : random();' '  f([&] { return random(); }, [&] { return random(); });' \
  '}' >"$tree/Testing/A.cpp"
expect holds Draws
rm "$tree/Testing/A.cpp"

mkdir -p "$tree/Testing/Unit/Math"
held=()
plant Threads Testing/Unit/Math/ATest.cpp '#include <thread>\n' Math
commands=$tree/compile_commands.json
printf '"file": "/p/Testing/Unit/Math/ATest.cpp"\n' >"$commands"
printf '\n' >"$tree/Testing/Unit/Math/ATest.cpp"
plant Tests Testing/Unit/Math/BTest.cpp '\n' "$commands" Unit
plant Tests Testing/Unit/BTest.cpp '\n' "$commands" Unit -Unit/Math
planted="a test in no batch"
printf '"file": "%s/unity_0_cxx.cxx"\n' "$tree" >"$commands"
printf '#include "/p/Testing/Unit/Math/ATest.cpp"\n' >"$tree/unity_0_cxx.cxx"
expect holds Tests "$commands" Unit
printf '\n' >"$tree/Testing/Unit/Math/BTest.cpp"
expect fails Tests "$commands" Unit
rm -r "$tree/Testing/Unit" "$commands" "$tree/unity_0_cxx.cxx"

planted="a link that leads nowhere"
printf '[b](b.md)\n' >"$tree/Examples/A.md"
expect fails Links
touch "$tree/Examples/b.md"
expect holds Links
planted="code that looks like a link"
printf '```cpp\n[](double x) {}\n```\n' >"$tree/Examples/A.md"
expect holds Links
rm -r "$tree/Examples/A.md"
planted="a page that the map does not name"
mkdir "$tree/Docs"
printf '[a](A.md)\n' >"$tree/Docs/Map.md"
touch "$tree/Docs/A.md"
expect holds Links
touch "$tree/Docs/B.md"
expect fails Links
rm -r "$tree/Docs"

planted="a picture of 400,001 bytes"
truncate --size 400001 "$tree/Examples/A.png"
expect fails Pictures
truncate --size 400000 "$tree/Examples/A.png"
expect holds Pictures
rm "$tree/Examples/A.png"

planted="a subject of 73 characters"
commit() { git -C "$tree" -c user.name=a -c user.email=a commit -q --allow-empty --no-verify -m "$1"; }
if git -C "$tree" init -q 2>/dev/null; then
  long="Math: $(printf 'a%.0s' {1..67})"
  commit "$long"
  start=$(git -C "$tree" rev-parse HEAD)
  commit "${long%a}"
  expect holds Subjects "$start"
  commit "$long"
  expect fails Subjects "$start"
  [[ $(bash "$check" Subjects "$tree" 0000000) == skipped* ]] || { echo "Subjects does not skip"; missed=1; }

  planted="old figures"
  figures=$tree/Docs/Data/Performance.csv
  mkdir -p "${figures%/*}"
  printf 'table,commit\nrace,%s\n' "$start" >"$figures"
  expect holds Figures 0
  git -C "$tree" add -f Source
  commit "Source: change"
  expect holds Figures 1
  expect fails Figures 0
  printf 'race,%s-dirty\n' "$start" >>"$figures"
  expect fails Figures 1
  printf 'table,commit\nrace,0000000\n' >"$figures"
  [[ $(bash "$check" Figures "$tree" 0) == skipped* ]] || { echo "Figures does not skip"; missed=1; }
  rm -rf "$tree/.git"
fi

planted="a stray symbol"
printf 'namespace palpate { int a; }\n' | "$compiler" -shared -fPIC -x c++ -o "$tree/lib.so" -
expect holds Symbols "$tree/lib.so"
printf 'namespace palpate { int a; } int b;\n' | "$compiler" -shared -fPIC -x c++ -o "$tree/lib.so" -
expect fails Symbols "$tree/lib.so"

printf 'namespace palpate { int a; } extern "C" int palpate_b() { return 1; }\n' |
  "$compiler" -shared -fPIC -x c++ -o "$tree/lib.so" -
expect fails Symbols "$tree/lib.so"
"$compiler" -shared -fPIC -o "$tree/lib.so" -x c++ -Wl,--version-script="$root/CMake/exports.map" \
  -Wl,--version-script="$root/CMake/exportsOfC.map" - \
  <<<'namespace palpate { int a; } extern "C" int palpate_b() { return 1; }'
expect holds Symbols "$tree/lib.so"

planted="flags of one file"
commands=$tree/compile_commands.json
printf '"command": "c++ -O2 -o a.o -c /p/Source/Math/a.cpp",\n' >"$commands"
expect holds Flags "$commands"
printf '"command": "c++ -O2 -march=native -o a.o -c /p/Source/Math/a.cpp",\n' >"$commands"
expect fails Flags "$commands"
expect holds Flags "$commands" -march=native
exit $missed
