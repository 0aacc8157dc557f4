#!/bin/bash
# nehalem.sh PROGRAM [ARGUMENT...]: runs it on an emulated Nehalem; 77 (skipped) without the emulator.
command -v qemu-x86_64 >/dev/null || {
  echo "skipped: qemu-x86_64 (package qemu-user) is not installed"
  exit 77
}
cd "$(mktemp -d)" || exit 1 # a trapped program leaves a core file
trap 'rm -rf "$PWD"' EXIT
qemu-x86_64 -cpu Nehalem "$@"
