#!/bin/bash
# subproject.sh SOURCE FOLDER COMPILER: a project that has Palpate as its part builds one library of it, and no example, test or
# adapter, and installs nothing of it. The build is only planned: all other tests compile the same files.
set -euo pipefail
source=$1 folder=$2 compiler=$3
rm -rf "$folder"
cmake -S "$source/Testing/Consumer/AsSubproject" -B "$folder" -G Ninja -DPALPATE="$source" -DCMAKE_CXX_COMPILER="$compiler" >/dev/null
# The outputs of the commands that link.
linked=$(ninja -C "$folder" -t commands all | grep -oE '(-o|qc) [^ ]*(libPalpate[^ ]*|simulator)( |$)' |
  sed -E 's/^[^ ]* //; s/ $//; s/.*\///' | grep -v '\.o$' | sort -u | tr '\n' ' ')
[[ $linked =~ ^libPalpate\.(so\.[0-9.]+|a)\ simulator\ $ ]] || { echo "linked: $linked" >&2; exit 1; }
if grep -rqs libPalpate "$folder/_deps/palpate-build" --include=cmake_install.cmake; then
  echo "Palpate would be installed with the project" >&2
  exit 1
fi
