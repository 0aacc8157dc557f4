#!/bin/bash
# CMake/packages.sh SET...: installs the Debian packages of the named sets (core, demo, build, python, test, matrix, docs,
# figures, benchmark, coverage, package, windows), as root or through sudo. Returns at once when all are there. Otherwise it
# says first how many packages come, of what size. Where it cannot install all of them it installs none, and says why in
# one line.
# CMake/packages.sh --missing SET...: installs nothing; fails when all are there.
set -euo pipefail

# What the library alone needs.
core="cmake ninja-build g++ pkg-config libeigen3-dev libhwy-dev libgmp-dev"
build="$core libtbb-dev libmeshoptimizer-dev libvtk9-dev libfcl-dev libccd-dev libcli11-dev nlohmann-json3-dev xvfb xauth libgl1-mesa-dri"
# All that CMake/demo.sh needs.
demo="$core libvtk9-dev libcli11-dev nlohmann-json3-dev xvfb xauth libgl1-mesa-dri"
# All that pip needs to build the Python package, and SciPy for rows().
python="$core libmeshoptimizer-dev python3-dev pybind11-dev python3-numpy python3-scipy python3-pip python3-venv python3-setuptools python3-wheel"
# What CMake/test.sh needs besides.
test="python3 python3-pytest python3-mypy mypy python3-distributed libgtest-dev libcgal-dev libmpfr-dev python3-vtk9
  python3-matplotlib"
# What CMake/test.sh --all needs besides: conventions, other processors, reports in a browser, C#, sanitizers.
matrix="clang-format-14 clang-tidy-14 qemu-user g++-aarch64-linux-gnu chromium mono-mcs mono-runtime clang-14
  libclang-rt-14-dev"
docs="doxygen python3-sphinx furo python3-myst-parser python3-breathe python3-sphinx-copybutton nodejs chromium"
windows="g++-mingw-w64-x86-64-posix wine64 dpkg-dev libgtest-dev"
package="lintian dpkg-dev fakeroot help2man"
figures="python3 python3-matplotlib python3-pil pngquant"
benchmark="python3 libbenchmark-dev libembree-dev libbullet-dev libcgal-dev libnanoflann-dev
  libopenvdb-dev"
coverage="python3 gcovr"

sets="core demo build python test matrix docs figures benchmark coverage package windows"
page="Docs/CMakeOptions.md#dependencies says what each part needs"
spareMegabytes=500  # stay free on the disk

# fail TEXT: one line, on which nothing was installed.
fail() {
  echo "packages: $1" >&2
  exit 1
}

# requireVersion COMMAND LEAST: fails if the command is older. COMMAND -dumpversion or --version has the version.
requireVersion() {
  local command=$1 least=$2 path version
  path=$(command -v "$command") || fail "there is no $command in PATH"
  if [[ $("$command" --version) == *clang* ]]; then least=14; fi
  version=$("$command" -dumpfullversion 2>/dev/null || "$command" -dumpversion 2>/dev/null || "$command" --version)
  version=$(grep -m 1 -oE '[0-9]+(\.[0-9]+)*' <<<"$version")
  printf '%s\n' "$least" "$version" | sort --check=quiet --version-sort && return
  fail "$path is version $version; Palpate needs $least. Put a newer one first in PATH$3; $page"
}
# What the sets name is what CMake finds: an older compiler or CMake may come first in PATH.
requireTools() {
  [[ " $packages " == *" g++ "* ]] || return 0
  local compiler=${CXX:-c++}  # CXX may begin with ccache and end with options
  compiler=${compiler#ccache }
  requireVersion "${compiler%% *}" 12 ", or name it by CXX"
  requireVersion cmake 3.25 ""
}

onlyAsks=0
if [[ ${1-} == --missing ]]; then
  onlyAsks=1
  shift
fi
packages=
for set in "$@"; do
  [[ " $sets " == *" $set "* ]] || fail "there is no set $set; the sets are: $sets"
  packages+=" $(echo ${!set})"
done
missing=()
for package in $packages; do
  state=$(dpkg-query -W -f='${db:Status-Status}' "$package" 2>/dev/null || true)
  [[ $state == installed || " ${missing[*]-} " == *" $package "* ]] || missing+=("$package")
done
((!onlyAsks)) || exit $((${#missing[@]} == 0))
if [[ ${#missing[@]} -eq 0 ]]; then
  requireTools
  exit 0
fi

# The names are Debian 12's, and the versions there are the tested ones.
system=$(cat /etc/os-release 2>/dev/null || true)
valueOf() { sed -nE "s/^$1=\"?([^\"]*)\"?\$/\1/p" <<<"$system"; }
if [[ $(valueOf ID) != debian || $(valueOf VERSION_ID) != 12 ]]; then
  name=$(valueOf PRETTY_NAME)
  fail "this is ${name:-$(uname -sr)}, and the names of packages are those of Debian 12. Install what they stand for yourself: ${missing[*]}; $page"
fi

if [[ $(id -u) -eq 0 ]]; then
  asRoot=()
elif ! command -v sudo >/dev/null; then
  fail "neither root nor sudo; as root, run: apt-get install --no-install-recommends ${missing[*]}"
elif ! sudo true; then
  fail "sudo gives no rights here; as root, run: apt-get install --no-install-recommends ${missing[*]}"
else
  asRoot=(sudo)
fi
aptGet() {
  "${asRoot[@]}" env DEBIAN_FRONTEND=noninteractive LC_ALL=C apt-get -q -o Dpkg::Use-Pty=0 \
    -o DPkg::Lock::Timeout=60 --no-install-recommends "$@" </dev/null
}
# The first error of apt in the text $1, or its first warning, or its last line.
reasonIn() {
  local line
  line=$(grep -m 1 '^E: ' <<<"$1" || grep -m 1 '^W: ' <<<"$1" || tail -n 1 <<<"$1")
  [[ $line != "E: Failed to fetch"* && $line != "W: Failed to fetch"* ]] || line=${line#*: Failed to fetch }
  echo "${line#[EW]: }"
}

# An old list of packages may do, so that only the download decides.
stale=
output=$(aptGet -o APT::Update::Error-Mode=any update 2>&1) || stale=$(reasonIn "$output")

# apt says what it would do, answers no, and returns 1; with an error it returns another code.
code=0
plan=$(aptGet install --assume-no "${missing[@]}" 2>&1) || code=$?
if [[ $code -gt 1 || $plan != *" newly installed,"* ]]; then
  [[ -z $stale ]] || fail "no network, or the mirror of apt does not answer ($stale). Nothing was installed."
  fail "apt cannot install them ($(reasonIn "$plan")). Nothing was installed; ${missing[*]}; $page"
fi
read -r count download unpacked <<<"$(awk '
  function megabytes(number, unit) {
    gsub(",", "", number)
    sub("/.*", "", unit)
    return number * (unit == "GB" ? 1000 : unit == "MB" ? 1 : unit == "kB" ? 1e-3 : 1e-6)
  }
  / newly installed,/ { count = $1 + $3 }
  /^Need to get / { download = megabytes($4, $5) }
  /^After this operation, .* additional / { unpacked = megabytes($4, $5) }
  END { printf "%d %d %d\n", count, download + 0.999, unpacked + 0.999 }' <<<"$plan")"
fresh=$(awk '/^The following NEW packages/ { on = 1; next } /^[^ ]/ { on = 0 } on' <<<"$plan")

# apt compares the download with the disk, and not what it unpacks. Without /proc df knows no disks, and apt decides.
disks=$(df -P -B 1000000 /usr /var/cache/apt/archives 2>/dev/null | awk 'NR > 1 { print $6, $4 }' | sort -u || true)
while read -r disk free; do
  [[ -n $free ]] || continue
  need=$spareMegabytes
  for folder in "/usr $unpacked" "/var/cache/apt/archives $download"; do
    [[ $(df -P "${folder% *}" | awk 'END { print $6 }') != "$disk" ]] || need=$((need + ${folder#* }))
  done
  ((free >= need)) || fail "the disk at $disk has $free MB free, and $need MB are needed. Nothing was installed."
done <<<"$disks"

# Ten megabytes a second from the mirror, twenty to the disk, five packages a second: what a container does.
minutes=$(((download / 10 + unpacked / 20 + count / 5) / 60 + 1))
echo "packages: apt installs $count packages for ${missing[*]}"
echo "packages: $download MB to download, $unpacked MB on the disk, about $minutes min at 10 MB/s"

output=$(aptGet install -y --download-only "${missing[@]}" 2>&1) ||
  fail "no network, or the mirror of apt does not answer ($(reasonIn "$output")). Nothing was installed."
# What apt began it takes back, so that a later call does not meet half of it.
if ! output=$(aptGet install -y "${missing[@]}" 2>&1); then
  if aptGet purge -y $fresh >/dev/null 2>&1; then
    fail "apt failed ($(reasonIn "$output")). What it had begun is removed again."
  fi
  fail "apt failed ($(reasonIn "$output")), and so did the removal of what it had begun; apt-get -f install says more"
fi
requireTools
