#!/bin/bash
# CMake/docs.sh [--layout]: builds the documentation site into build/docs/html, with packages of Debian and without
# network. Fails on any warning: a broken link between pages, a page that no table of contents names, a name that Doxygen
# cannot resolve; and if the search does not find what readers look for. --layout: fails, too, if a page does not fit its
# window, in minutes.
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
# Each example is a page with its highlighted source.
find Examples -name '*.cpp' -o -name '*.h' -o -name '*.py' | while read -r file; do
  mkdir -p "$out/source/$(dirname "$file")"
  cp "$file" "$out/source/$file"
  language=cpp
  [[ $file != *.py ]] || language=python
  printf '# %s\n\n`%s`\n\n```{literalinclude} %s\n:language: %s\n```\n' \
    "$(basename "$file")" "$file" "$(basename "$file")" "$language" >"$out/source/$file.md"
done
{
  printf '# Source of the examples\n\n[Example scenes](../Docs/Scenes.md) says what each scene shows.\n'
  for folder in $(cd Examples && ls -d */ | tr -d /); do
    pages=$(cd "$out/source/Examples" && ls "$folder"/*.md 2>/dev/null | sed 's/\.md$//') || continue
    printf '\n## %s\n\n```{toctree}\n:maxdepth: 1\n%s\n```\n' "$folder" "$pages"
  done
} >"$out/source/Examples/index.md"
find "$out/source" -name '*.md' | xargs sed -Ei 's#\(((\.\./)*Examples/[A-Za-z/]+\.(cpp|h|py))\)#(\1.md)#g'
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
  echo "INPUT = Source/Public/palpate Source/Simplify/Public/palpate Source/Adapters/MeshFiles/Public/palpate Source/Adapters/Vtk/Public/palpate Source/Adapters/Fcl/Public/palpate Source/Adapters/iMSTK/Public/palpate"
  echo "OUTPUT_DIRECTORY = $out/doxygen"
  echo "INPUT_FILTER = \"python3 Docs/Site/filter.py\""
} >"$out/Doxyfile"
doxygen "$out/Doxyfile"
mkdir "$out/source/reference"
find Source -path '*Public/palpate/*.h' ! -name palpate_c.h | sort | xargs python3 Docs/Site/reference.py "$out/doxygen/xml" "$out/source/reference"
python3 -B Docs/Site/pythonReference.py "$out/source/reference/python"
sphinx-build -W --keep-going -q -b html -c Docs/Site "$out/source" "$out/html"
# Debian's furo refers to a style sheet by an address of the server.
cp /usr/share/javascript/normalize.css/normalize.css "$out/html/_static/styles/"
sed -i 's#/javascript/normalize.css/##' "$out/html/_static/styles/furo.css"

node Testing/Documentation/search.js "$out/html"  # what a reader finds by the search
echo "The documentation is in build/docs/html/index.html."
[[ ${1:-} == --layout ]] || exit 0
# What every page looks like at three widths of the window.
timeout 1200 chromium --headless --no-sandbox --disable-gpu --allow-file-access-from-files --virtual-time-budget=100000000 \
  --window-size=1400,1000 --dump-dom "file://$PWD/Testing/Documentation/layout.html?$out/html" 2>/dev/null >"$out/layout.html"
awk '/<pre id="result">/ { on = 1 } on { last = /<\/pre>/; gsub(/<[^>]*>/, ""); print } last { exit }' "$out/layout.html"
grep -q 'layout: .* pages, 0 faults' "$out/layout.html"
