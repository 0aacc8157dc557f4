#!/bin/bash
# CMake/docs.sh: builds the documentation site into build/docs/html, with packages of Debian and without network. Fails
# on any warning: a broken link between pages, a page that no table of contents names, a name that Doxygen cannot resolve.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

CMake/packages.sh docs
out=$PWD/build/docs
rm -rf "$out"
mkdir -p "$out/source" "$out/doxygen"

# The pages keep their places, so that their links are the same here and in the repository.
find README.md CHANGELOG.md CONTRIBUTING.md Docs Data Examples -name '*.md' 2>/dev/null | while read -r page; do
  mkdir -p "$out/source/$(dirname "$page")"
  cp "$page" "$out/source/$page"
done
find Docs/Data -name '*.csv' | xargs cp --parents -t "$out/source"
find Examples -name '*.cpp' -o -name '*.h' | xargs cp --parents -t "$out/source"  # pages link to them
[[ ! -d Docs/Pictures ]] || cp -r --parents -t "$out/source" Docs/Pictures
sed 's#](../#](Docs/#g' Docs/Site/index.md >"$out/source/index.md"
rm -r "$out/source/Docs/Site"

# The page of the notes lists the notes.
{
  printf '# Notes for developers\n\nOne page for each module: what to know before a change, and designs that failed.\n\n'
  printf '```{toctree}\n:maxdepth: 1\n'
  (cd Docs/Notes && ls *.md | sed 's/\.md$//')
  printf '```\n'
} >"$out/source/Docs/Notes/index.md"

PALPATE_VERSION=$(sed -nE 's/^project\(Palpate VERSION ([0-9.]+).*/\1/p' CMakeLists.txt)
export PALPATE_VERSION PALPATE_DOXYGEN_XML=$out/doxygen/xml
{
  cat Docs/Site/Doxyfile
  echo "INPUT = Source/Public/palpate Source/Simplify/Public/palpate Source/Adapters/MeshFiles/Public/palpate Source/Adapters/Vtk/Public/palpate Source/Adapters/Fcl/Public/palpate"
  echo "OUTPUT_DIRECTORY = $out/doxygen"
  echo "INPUT_FILTER = \"python3 Docs/Site/filter.py\""
} >"$out/Doxyfile"
doxygen "$out/Doxyfile"
mkdir "$out/source/reference"
find Source -path '*Public/palpate/*.h' | sort | xargs python3 Docs/Site/reference.py "$out/doxygen/xml" "$out/source/reference"
python3 -B Docs/Site/pythonReference.py "$out/source/reference/python"
sphinx-build -W --keep-going -q -b html -c Docs/Site "$out/source" "$out/html"
echo "The documentation is in build/docs/html/index.html."
