#!/bin/bash
# check.sh CHECK ROOT [ARGUMENT...]: checks one convention of the source tree, for example which module may include which.
# Prints each line at fault. Exit code 0: no fault, 1: faults, 77: skipped. testChecks.sh shows that each check can fail.
set -uo pipefail
scripts=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
cd "$2"
check=$1
shift 2
faults=0
fault() { echo "$*"; faults=1; }
sourceFiles() { find Source -name '*.h' -o -name '*.cpp' | sort; }

# The include lines of files, one a line: the file, and <name or "name
includesOf() {
  grep -HoE '^[[:space:]]*#[[:space:]]*include[[:space:]]+[<"][^>"]+' "$@" | sed -E 's/:[^<"]*/ /'
}

# What a module may include: folders, or files of them.
allowedIn() {
  case $1 in
    Core) echo "Core/" ;;
    Fields) echo "Fields/ Core/Archive.h Core/Assert.h" ;;
    Exact) echo "Exact/ Core/" ;;
    Math) echo "Math/ Exact/ Core/" ;;
    Mesh) echo "Mesh/ Math/ Exact/ Core/" ;;
    Shapes) echo "Shapes/ Mesh/ Math/ Exact/ Core/" ;;
    Contact) echo "Contact/ Shapes/ Mesh/ Math/ Exact/ Core/" ;;
    Octree) echo "Octree/ Math/Box Core/" ;;
    Bodies) echo "Bodies/ Octree/ Shapes/ Mesh/ Math/ Exact/ Core/" ;;
    NarrowPhase) echo "NarrowPhase/ Contact/ Shapes/ Mesh/ Math/ Exact/ Core/" ;;
    Queries) echo "Queries/ Bodies/ NarrowPhase/ Contact/ Octree/ Shapes/ Mesh/ Math/ Exact/ Core/" ;;
    DistanceField) echo "DistanceField/ Queries/ Bodies/ Octree/ Shapes/ Mesh/ Math/ Exact/ Core/" ;;
    Simplify) echo "Simplify/ Queries/ Bodies/ Octree/ Mesh/ Math/ Exact/ Core/" ;;
    Validity) echo "Validity/ NarrowPhase/ Contact/ Mesh/ Math/ Core/" ;;
    Tracking) echo "Tracking/ NarrowPhase/ Contact/ Mesh/ Math/ Exact/ Core/" ;;
    Search) echo "Search/ Validity/ DistanceField/ Queries/ Bodies/ NarrowPhase/ Contact/ Octree/ Shapes/ Mesh/ Math/ Core/" ;;
    CollisionDetection) echo "CollisionDetection/ Search/ Tracking/ Validity/ DistanceField/ Queries/ Bodies/ NarrowPhase/ Contact/ Octree/ Shapes/ Mesh/ Math/ Fields/ Core/" ;;
    Diagnostics) echo "Diagnostics/ CollisionDetection/ Search/ DistanceField/ Bodies/ NarrowPhase/ Contact/Contact Contact/Contents.h Contact/DistinctShape Contact/Filters.h Contact/Mesh Contact/Order.h Contact/Piercing.h Contact/TouchNormal.h Shapes/ Mesh/ Math/ Fields/ Core/" ;;
    MeshFiles) echo "MeshFiles/ Core/WholeFile.h" ;;
    C) echo "C/ Fields/" ;;
    Python) echo "Python/ Fields/ Contact/ContactLists.h" ;;
    Vtk | Fcl | iMSTK) echo "$1/" ;;
  esac
}

# Includes go down the table only; Core sees no more of Public than its plain types.
checkIncludes() {
  local file include prefix module="" of allowed
  while read -r file include; do
    of=${file#Source/} of=${of#Adapters/} of=${of%%/*}  # the folder in Source, or in Source/Adapters
    [[ $of == "$module" ]] || module=$of allowed=$(allowedIn "$of")
    case $include in
      \"*)
        for prefix in $allowed; do [[ ${include#\"} == "$prefix"* ]] && continue 2; done
        fault "$file: $module may not include ${include#\"}"
        ;;
      "<palpate/"*)
        [[ $module != Core || $include =~ ^.palpate/(Types|Error|Export|Executor|Settings|FrameStatistics)\.h$ ]] ||
          fault "$file: Core may include Public's plain types only, not ${include#<}"
        ;;
    esac
  done < <(includesOf $(sourceFiles))
}

# Each library in its one place; besides them the standard library and Eigen's Core and Geometry only.
checkPlaces() {
  local file include place
  while read -r file include; do
    case $include in
      \"* | "<palpate/"* | "<Eigen/Core" | "<Eigen/Geometry") continue ;;
      "<tbb/"* | "<oneapi/"* | "<thread" | "<future" | "<execution" | "<pthread.h")
        place=Source/Core/Threads.cpp ;;
      "<stddef.h" | "<stdint.h") place=Source/Public/palpate/palpate_c.h ;;
      "<condition_variable") place=Source/Core/ ;;
      "<hwy/"*) place=Source/Core/Simd.h ;;
      "<meshoptimizer.h") place=Source/Simplify/Meshoptimizer/Simplify.cpp ;;
      "<gmp"*) place=Source/Exact/Exact.h ;;
      "<vtk"* | "<X11/"*) place=Source/Adapters/Vtk/ ;;
      "<fcl/"* | "<ccd/"*) place=Source/Adapters/Fcl/ ;;
      "<imstk"*) place=Source/Adapters/iMSTK/ ;;
      "<pybind11/"*) place=Source/Adapters/Python/Arrays.h ;;
      *[./]*) place=nowhere ;;
      *) continue ;;
    esac
    [[ $file == "$place"* ]] || fault "$file: ${include#<} may be included in $place only"
  done < <(includesOf $(sourceFiles))
}

# Each public header compiles alone, palpate_c.h as C99, too. It includes nothing of Eigen but Core and Geometry, and
# reaches no file that these and the standard library do not. Palpate.h includes all headers of the library. OctreeBasedCD.h reaches no
# distance fields, captures and simplification.
# Headers for iMSTK need iMSTK; Testing/Imstk compiles them. Arguments: the compiler, Eigen's folder.
checkPublicHeaders() {
  local compile=("$1" -std=c++20 -Wall -Wextra -Wconversion -Wshadow -Werror -x c++ -I. -ISource/Public -ISource/Simplify/Public
    -ISource/Adapters/MeshFiles/Public -ISource/Adapters/Vtk/Public -ISource/Adapters/Fcl/Public -isystem "$2") header include
  local lists allowed
  lists=$(mktemp -d)
  allowed=$lists/allowed
  # The files that the preprocessor, with these options, reads.
  reached() { "${compile[@]}" -M "$@" | tr ' \\' '\n\n' | grep / | sort -u; }
  printf '#include <bits/stdc++.h>\n#include <Eigen/Core>\n#include <Eigen/Geometry>\n' |
    reached -D_GLIBCXX_USE_TBB_PAR_BACKEND=0 - >"$allowed"
  # Chains of headers: each reaches all that those before it in its chain reach. They are compiled together, and yet each
  # sees only files that it reaches itself.
  local chains=() last=() files i
  while read -r _ header; do
    files=$lists/${header//\//_}
    for ((i = 0; i < ${#chains[@]}; ++i)); do
      [[ -z $(comm -23 "${last[i]}" "$files") ]] && break
    done
    chains[i]+=" $header" last[i]=$files
  done < <(
    for header in $(find Source -path '*Public/palpate/*.h' -not -path '*/iMSTK/*' | sort); do
      files=$lists/${header//\//_}
      reached -include "$header" /dev/null >"$files"
      echo "$(wc -l <"$files") $header"
    done | sort -n)
  for ((i = 0; i < ${#chains[@]}; ++i)); do
    printf '#include "%s"\n' ${chains[i]} | "${compile[@]}" -fsyntax-only - && continue
    for header in ${chains[i]}; do
      "${compile[@]}" -fsyntax-only -include "$header" /dev/null 2>/dev/null || fault "$header does not compile alone"
    done
    ((faults)) || fault "headers do not compile together:${chains[i]}"
  done
  for header in $(find Source -path '*Public/palpate/*.h' -not -path '*/iMSTK/*' | sort); do
    files=$lists/${header//\//_}
    if [[ $header == */palpate_c.h ]]; then
      "$1" -x c -std=c99 -Wall -Wextra -Wc++-compat -pedantic -Werror -ISource/Public -fsyntax-only -include "$header" /dev/null ||
        fault "$header is not C99"
      continue
    fi
    if [[ $header == */OctreeBasedCD.h ]]; then
      while read -r include; do fault "$header reaches $include"; done < <(grep -E '/(DistanceField|Capture|Simplify)\.h$' "$files")
    fi
    if [[ $header == */Palpate.h ]]; then
      for include in Source/Public/palpate/[A-Z]*.h; do
        grep -qx "$include" "$files" || fault "$header does not include $include"
      done
    fi
    while read -r _ include; do
      [[ $include =~ ^.palpate/(vtk/|fcl/)?[A-Za-z]+\.h$|^\<Eigen/(Core|Geometry)$|^\<[a-z_]+$ ]] ||
        fault "$header includes ${include:1}"
    done < <(includesOf "$header")
    while read -r include; do fault "$header reaches $include"; done < <(
      comm -13 "$allowed" "$files" | grep -vE '^(Source/((Adapters/(MeshFiles|Vtk|Fcl)|Simplify)/)?Public/palpate/|/dev/null)')
  done
  rm -r "$lists"
}

# No two headers define the same name: of inline functions with one name, the linker takes any. Left out are headers that
# are compiled once for each instruction set. Arguments: the compiler, Eigen's folder.
checkHeaders() {
  local errors
  errors=$(find Source -name '*.h' -not -path '*/Adapters/*' -exec grep -l '^#pragma once' {} + |
    { xargs grep -L '"Core/Simd.h"' || true; } | sort | sed 's|.*|#include "&"|' |
    "$1" -std=c++20 -x c++ -fsyntax-only -DPALPATE_SCALAR -DPALPATE_THREADS_STD -I. -ISource -ISource/Public -ISource/Simplify/Public -isystem "$2" - 2>&1) ||
    fault "headers do not compile together: $errors"
}

# A shared library exports nothing but namespace palpate and the C interface (Testing/C has its list), and the names of
# versions. Arguments: the libraries.
checkSymbols() {
  local library symbol
  for library in "$@"; do
    nm -D --defined-only "$library" | grep 7palpate >/dev/null || fault "$library exports nothing of palpate"
    while read -r symbol; do fault "$library exports $symbol"; done < <(
      nm -D --defined-only "$library" | awk '$2 != "A" {print $3}' |
        grep -vE '^palpate_[a-z_]+@@PALPATE_C_|^_Z(T[ISVT]|G[VR]|Z)?N?[VKRO]*7palpate' | c++filt)
  done
}

# No file of Source is compiled with -m flags of its own. Arguments: the compile commands, flags given for all.
checkFlags() {
  local commands=$1 line
  [[ -s $commands ]] || fault "$commands is missing"
  while read -r line; do fault "$line"; done < <(
    grep '"command"' "$commands" | sed "s|${2:- }| |g" |
      grep -oE ' -(m[a-z][^ ]*|ffast-math|Ofast) .* -c [^ ]*/Source/[^ ]*' | sed -E 's| .* -c | for |')
}

# Each *Test.cpp below the given folders of Testing is compiled, by itself or in a batch; a test that no target lists never
# runs. Arguments: the compile commands, then folders, and files or folders with a leading "-" that this configuration
# leaves out.
checkTests() {
  local commands=$1 argument folders=() without=() file left compiled
  shift
  [[ -s $commands ]] || fault "$commands is missing"
  compiled=$(cat "$commands" $(grep -oE '"file": "[^"]*/unity_[0-9]+_cxx\.cxx"' "$commands" | cut -d '"' -f 4))
  for argument in "$@"; do
    if [[ $argument == -* ]]; then without+=("${argument#-}"); else folders+=("$argument"); fi
  done
  while read -r file; do
    for left in "${without[@]}"; do [[ $file == "Testing/$left"* ]] && continue 2; done
    grep -qF -- "/$file\"" <<<"$compiled" || fault "$file is compiled into no test"
  done < <(for argument in "${folders[@]}"; do find "Testing/$argument" -name '*Test.cpp'; done | sort)
}

# The given modules start no threads: they and their unit tests include none of the files that do.
checkThreads() {
  local module line
  for module in "$@"; do
    while read -r line; do fault "$module starts threads, so ThreadSanitizer has to run its tests: $line"; done < <(
      grep -rnE '^[[:space:]]*#[[:space:]]*include[[:space:]]+("Core/Threads\.h"|<(thread|future|execution)>)' \
        "Source/$module" "Testing/Unit/$module" 2>/dev/null)
  done
}

checkFormat() {
  local tool
  tool=$(command -v clang-format-14) || {
    echo "skipped: clang-format-14 is not installed"
    exit 77
  }
  local marker
  while read -r marker; do fault "conflict marker: $marker"; done < <(
    grep -rnE '^(<<<<<<<|>>>>>>>) ' --exclude-dir=build --exclude-dir=out --exclude-dir=.git .)
  find Source Examples Testing -name '*.h' -o -name '*.cpp' | xargs "$tool" --dry-run -Werror --style=file || faults=1
}

# Names as .clang-tidy says. clang-tidy takes 6 s for what Eigen declares, so that many files are checked at once: all
# headers of the modules, or the sources of one. Sources with kernels name the same things, and are checked one at a
# time, as scalar code. Adapters have names of other libraries, and the C interface those of C.
# Arguments: Eigen's folder, "headers" or a module.
checkNames() {
  local eigen=$1 part=$2 tool file options unit
  tool=$(command -v clang-tidy-14) || {
    echo "skipped: clang-tidy-14 is not installed"
    exit 77
  }
  options=(-std=c++20 -DPALPATE_SCALAR -DPALPATE_THREADS_STD -I. -ISource -ISource/Public -ISource/Simplify/Public
    -isystem "$eigen")
  unit=$(mktemp --suffix=.cpp)
  namesIn() {
    local output
    output=$("$tool" --quiet --config-file=.clang-tidy --header-filter='/Source/' "$1" -- "${options[@]}" 2>/dev/null) ||
      fault "$output"
  }
  if [[ $part == headers ]]; then
    find Source -name '*.h' ! -path '*/Adapters/*' ! -name palpate_c.h -exec grep -l '^#pragma once' {} + |
      { xargs grep -L '"Core/Simd.h"' || true; } | sort | sed "s|.*|#include \"$PWD/&\"|" >"$unit"
    namesIn "$unit"
  else
    find "Source/$part" -name '*.cpp' -exec grep -L '"Core/Simd.h"' {} + | sort | sed "s|.*|#include \"$PWD/&\"|" >"$unit"
    namesIn "$unit"
    while read -r file; do namesIn "$file"; done < <(
      find "Source/$part" -name '*.cpp' -exec grep -l '"Core/Simd.h"' {} + | sort)
  fi
  rm "$unit"
}

# Subjects of commits have at most 72 characters, from the commit after START on: earlier ones were not checked. A tree
# without history, or with a part of it, is not checked. Argument: START.
checkSubjects() {
  local start=$1 LC_ALL=C.UTF-8 commit subject
  git rev-parse --quiet --verify "$start^{commit}" >/dev/null 2>&1 || {
    echo "skipped: there is no history with the commit $start"
    exit 77
  }
  while read -r commit subject; do
    ((${#subject} <= 72)) || fault "$commit: ${#subject} characters: $subject"
  done < <(git log --no-merges --format='%h %s' "$start..HEAD")
}

# All figures of the tables in Docs are of one commit, and at most MOST later ones changed Source. A tree without
# history, or with a part of it, is not checked. Argument: MOST.
checkFigures() {
  local figures=Docs/Data/Performance.csv most=$1 commits commit changes
  commits=$(tail -n +2 $figures | sed 's/.*,//' | sort -u)
  [[ $(wc -l <<<"$commits") -eq 1 && $commits =~ ^[0-9a-f]+$ ]] || {
    fault "$figures: the figures are not of one commit: $(tr '\n' ' ' <<<"$commits")"
    return
  }
  commit=$(git rev-parse --quiet --verify "$commits^{commit}" 2>/dev/null) || {
    echo "skipped: there is no history with the commit $commits"
    exit 77
  }
  changes=$(git rev-list --count "$commit..HEAD" -- Source)
  ((changes <= most)) ||
    fault "$figures: since its commit $commits $changes commits changed Source, more than $most: run CMake/benchmark.sh"
}

# Each source file has a header of its name, beside it or public, or its first line says of which header it is a part.
checkParts() {
  local file name header public
  public=$(find Source -path '*Public/*/*.h')$'\n'
  while read -r file; do
    name=${file##*/} name=${name%.cpp}.h
    [[ -e ${file%.cpp}.h || $public == *"/$name"$'\n'* ]] && continue
    header=$(sed -nE '1s|^// Part of <?([A-Za-z/_]+\.h)>?: .*|\1|p' "$file")
    [[ -n $header && -n $(find Source -path "*/$header") ]] || fault "$file: the first line names no header"
  done < <(sourceFiles | grep '\.cpp$')
}

# Random draws have an order: tests give the same numbers with each compiler.
checkDraws() {
  find Testing Examples \( -name '*.h' -o -name '*.cpp' \) -print0 | sort -z |
    xargs -0 python3 "$scripts/draws.py" || faults=1
}

# Names that say nothing. The size of Source is printed, and not judged.
# stableNorm() adds in an order that depends on the vector's address; Math/StableLength.h does not.
checkWords() {
  local line lines
  while read -r line; do fault "stableLength() instead: $line"; done < <(
    sourceFiles | xargs grep -nE '(\.|->)stableNorm\(')
  while read -r line; do fault "banned name: $line"; done < <(
    grep -rnE --include='*.h' --include='*.cpp' '[A-Za-z](Manager|Helper|Utils)\b|\b(Manager|Helper|Utils)|\bdata2\b' \
      Source Examples Testing | grep -vE '\b(ParallelUtils|(imstk)?ThreadManager)\b'  # iMSTK's
    find Source Examples Testing -name '*Manager*' -o -name '*Helper*' -o -name '*Utils*')
  lines=$(sourceFiles | xargs cat | grep -cvE '^[[:space:]]*(//.*)?$')
  echo "Source has $lines lines of code, $(sourceFiles | xargs cat | wc -l) with comments and blanks"
}

# Every enumeration of the public headers, but ids, has toString() beside it, which returns the enumerators' names.
checkEnumerations() {
  local file name line
  while read -r file; do
    while read -r name; do
      grep -qE "toString\(([A-Za-z]+::)?$name\)" "$file" || fault "$file: no toString($name)"
    done < <(grep -E 'enum class' "$file" | grep -v '{};' | sed -E 's/.*enum class ([A-Za-z]+).*/\1/')
  done < <(find Source -path '*Public*' -name '*.h' | sort)
  while read -r line; do fault "toString() returns another name: $line"; done < <(
    sourceFiles | xargs awk '
      /^    case [A-Za-z0-9:]+:$/ { name = $2; sub(/:$/, "", name); sub(/.*:/, "", name); next }
      name != "" && /^      return "/ && $0 != "      return \"" name "\";" { print FILENAME ": " name }
      { name = "" }')
}

# Assertions, counted for each module: a module with code has some.
checkAssertions() {
  local module count
  for module in Source/*/; do
    module=$(basename "$module")
    [[ $module == Public || $module == Adapters || $module == Core ]] && continue
    [[ -n $(find "Source/$module" -name '*.h' -o -name '*.cpp') ]] || continue
    count=$(grep -rhoE '\bPALPATE_ASSERT\(' "Source/$module" | wc -l)
    echo "$module: $count assertions"
    ((count > 0)) || faults=1
  done
}

# Nothing prints and nothing exits, but an assertion that fails.
checkQuiet() {
  local line
  while read -r line; do fault "$line"; done < <(
    sourceFiles | grep -v '^Source/Core/Assert.h$' |
      xargs grep -nE '\b(cout|cerr|clog|printf|fprintf|puts|fputs|exit|abort|terminate)\b *(\(|<<|;)')
}

# The links of the pages lead to files, and Docs/Map.md has a link to each page that is no note.
checkLinks() {
  local page link
  while read -r page; do
    while read -r link; do
      [[ $page/ != */*/ ]] || link=${page%/*}/$link
      [[ -e $link ]] || fault "$page: $link leads nowhere"
    done < <(sed '/^ *```/,/^ *```/d; /^ *<!--/,/-->/d' "$page" | grep -oE '\]\([^)#:]+\)' | tr -d '()]')
  done < <(find README.md CHANGELOG.md CONTRIBUTING.md SECURITY.md .github Docs Data Examples Testing -name '*.md' 2>/dev/null)
  while read -r page; do
    grep -qF "(${page#Docs/})" Docs/Map.md || fault "Docs/Map.md does not name $page"
  done < <(find Docs -name '*.md' ! -path 'Docs/Notes/*' ! -path 'Docs/Site/*' ! -name Map.md 2>/dev/null)
}

# Pages load soon: a picture has at most 400 kB, an animation 1500 kB.
checkPictures() {
  local file
  while read -r file; do fault "$file: too large for a page"; done < <(
    find Docs Data Examples \( -name '*.png' -o -name '*.svg' -o -name '*.jpg' \) -size +400000c 2>/dev/null
    find Docs Data Examples \( -name '*.webp' -o -name '*.gif' \) -size +1500000c 2>/dev/null)
}

"check$check" "$@"
exit $faults
