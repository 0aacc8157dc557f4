#!/bin/bash
# pkgConfig.sh PREFIX SOURCE COMPILER FOLDER: a program is compiled and linked by what pkg-config says of the installed tree, and
# runs.
set -euo pipefail
prefix=$1 source=$2 compiler=$3 folder=$4
libraries=$(find "$prefix" -name palpate.pc -printf '%h')
export PKG_CONFIG_PATH=$libraries
mkdir -p "$folder"
# shellcheck disable=SC2046 # words
"$compiler" -std=c++20 "$source" $(pkg-config --cflags --libs palpate) -o "$folder/contacts"
LD_LIBRARY_PATH=$(dirname "$libraries") "$folder/contacts" | grep "vertex 0 is 0.05 from triangle 0"
version=$(pkg-config --modversion palpate)
[[ $version =~ ^[0-9]+\.[0-9]+\.[0-9]+$ ]] || { echo "no version: $version" >&2; exit 1; }
