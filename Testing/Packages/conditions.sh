#!/bin/bash
# conditions.sh ROOT: what CMake/packages.sh says and does under bad conditions. All commands that it runs come from a
# folder of its own, where those that would change or ask the system are replaced.
set -uo pipefail
script=$1/CMake/packages.sh
here=$(mktemp -d)
trap 'rm -rf "$here"' EXIT
log=$here/log
failures=0

# fake COMMAND TEXT: a command of the folder, which logs its call.
fake() {
  rm -f "$here/bin/$1"
  printf '#!%s\necho "%s $*" >>%s\n%s\n' "$(command -v bash)" "$1" "$log" "$2" >"$here/bin/$1"
  chmod +x "$here/bin/$1"
}
# A Debian 12 with root, network, space and tools, on which no package is installed.
reset() {
  rm -rf "$here/bin"
  mkdir "$here/bin"
  for command in awk bash cat env grep sed sort tail uname; do
    ln -s "$(command -v "$command")" "$here/bin/$command"
  done
  : >"$log"
  fake dpkg-query 'exit 1'
  fake cat 'printf "PRETTY_NAME=\"Debian GNU/Linux 12\"\nID=debian\nVERSION_ID=\"12\"\n"'
  fake id 'echo 0'
  fake df 'case $* in
    *1000000*) printf "Filesystem MB Used Available Capacity Mounted\n/dev/a 9000 5000 4000 0%% /\n/dev/a 9000 5000 4000 0%% /\n" ;;
    *) printf "Filesystem MB Used Available Capacity Mounted\n/dev/a 9000 5000 4000 0%% /\n" ;; esac'
  fake apt-get 'case $* in
    *--assume-no*) printf "The following NEW packages will be installed:\n  g++ cmake\n  libfcl-dev\n3 upgraded, 211 newly installed, 0 to remove and 5 not upgraded.\nNeed to get 150 MB/310 MB of archives.\nAfter this operation, 1,2 GB of additional disk space will be used.\nAbort.\n" | sed s/1,2/1.2/
      exit 1 ;; esac'
  fake c++ 'case $* in -dumpfullversion) echo 12.2.0 ;; *) echo "c++ (Debian 12.2.0-14) 12.2.0" ;; esac'
  fake cmake '[[ $1 == --version ]] && echo "cmake version 3.25.1"'
}
say() {
  echo "$1: $2"
  failures=1
}
# expect CASE CODE PATTERN [SET...]: packages.sh ends with the code, and its output matches. A failure is one line.
expect() {
  local case=$1 code=$2 pattern=$3 found
  shift 3
  env CXX="${compiler-}" PATH="$here/bin" "$here/bin/bash" "$script" "${@:-build}" >"$here/out" 2>"$here/errors"
  found=$?
  [[ $found -eq $code ]] || say "$case" "ended with $found, not $code"
  [[ -z $pattern ]] || grep -qE -- "$pattern" "$here/out" "$here/errors" || say "$case" "says '$(cat "$here/out" "$here/errors")', not '$pattern'"
  [[ $code -eq 0 || ${1-} == --missing || $(wc -l <"$here/errors") -eq 1 ]] || say "$case" "prints $(wc -l <"$here/errors") lines of errors"
}
# The call that installs; of the two with -y, the one that does not stop after the download.
installs() { grep -E '^apt-get .* install -y ' "$log" | grep -qv -e --download-only; }
installed() { installs || say "$1" "installed nothing"; }
nothing() { if installs; then say "$1" "installed something"; fi; }

reset
expect "everything is well" 0 'apt installs 214 packages for cmake ninja-build g\+\+ '
installed "everything is well"
grep -q '^packages: 150 MB to download, 1200 MB on the disk, about 2 min' "$here/out" || say size "$(cat "$here/out")"
awk '/--download-only/ { loaded = 1 } / install -y / && !/--download-only/ { exit !loaded }' "$log" ||
  say order "the installation begins before the download has ended"

reset
fake dpkg-query 'echo installed'
expect "all are there" 0 ''
grep -q . "$here/out" && say "all are there" "prints $(cat "$here/out")"
grep -q '^apt-get' "$log" && say "all are there" "asks apt"
expect "none is missing" 1 '' --missing build
grep -q . "$here/out" && say "none is missing" "prints $(cat "$here/out")"
fake dpkg-query 'exit 1'
expect "some are missing" 0 '' --missing build
nothing "some are missing"

reset
expect "an unknown set" 1 'there is no set bulid; the sets are: core demo build python test matrix' bulid
nothing "an unknown set"

reset
fake cat 'printf "PRETTY_NAME=\"Fedora Linux 41\"\nID=fedora\nVERSION_ID=41\n"'
rm "$here/bin/dpkg-query" "$here/bin/apt-get"
expect "another distribution" 1 'this is Fedora Linux 41.*libeigen3-dev.*Docs/CMakeOptions.md#dependencies'
nothing "another distribution"
fake cat 'printf "PRETTY_NAME=\"Debian GNU/Linux 13\"\nID=debian\nVERSION_ID=\"13\"\n"'
expect "another Debian" 1 'this is Debian GNU/Linux 13.*libhwy-dev.*Docs/CMakeOptions.md#dependencies'
fake cat 'exit 1'
expect "an unknown system" 1 "this is $(uname -s) .*libhwy-dev"

reset
fake id 'echo 1000'
expect "no root, no sudo" 1 'neither root nor sudo; as root, run: apt-get install .*libgmp-dev'
nothing "no root, no sudo"
fake sudo 'exit 1'
expect "sudo refuses" 1 'sudo gives no rights here; as root, run: apt-get install .*libgmp-dev'
nothing "sudo refuses"
fake sudo '[[ $1 == true ]] || exec "$@"'
expect "sudo" 0 'about 2 min'
installed "sudo"
grep -q '^sudo env .*apt-get .* install -y ' "$log" || say sudo "does not install by sudo"

reset
fake apt-get 'case $* in
  *update*) echo "E: Failed to fetch http://deb.debian.org/InRelease  Could not resolve deb.debian.org"; exit 100 ;;
  *) echo "E: Unable to locate package cmake"; exit 100 ;; esac'
expect "no network, no lists" 1 'no network.*Could not resolve deb.debian.org.*Nothing was installed'
nothing "no network, no lists"
reset
plan=$(sed -n '3,$p' "$here/bin/apt-get")
fake apt-get "case \$* in
  *update*) echo 'W: Failed to fetch http://deb.debian.org/InRelease  Could not resolve deb.debian.org'; exit 100 ;;
  *--download-only*) echo 'E: Failed to fetch http://deb.debian.org/a.deb  Temporary failure'; exit 100 ;; esac
$plan"
expect "no network, old lists" 1 'no network.*a.deb  Temporary failure.*Nothing was installed'
nothing "no network, old lists"
fake apt-get "[[ \$* != *update* ]] || exit 100
$plan"
expect "an old list suffices" 0 'about 2 min'
installed "an old list suffices"

reset
fake apt-get '[[ $* != *--assume-no* ]] || { echo "Reading package lists..."; echo "E: Unable to locate package libhwy-dev"; exit 100; }'
expect "a package that apt does not know" 1 'apt cannot install them \(Unable to locate package libhwy-dev\).*Docs/CMakeOptions.md'
nothing "a package that apt does not know"

# 1,200 MB, 150 MB of archives and 500 MB that stay free.
reset
disk() {
  fake df "case \$* in
    *1000000*) printf 'Filesystem MB Used Available Capacity Mounted\n/dev/a 9 5 $1 0%% /\n/dev/b 9 5 $2 0%% /var\n' ;;
    */usr) printf 'Filesystem\n/dev/a 9 5 $1 0%% /\n' ;; *) printf 'Filesystem\n/dev/b 9 5 $2 0%% $3\n' ;; esac"
}
disk 1699 9000 /var
expect "no space for the packages" 1 'the disk at / has 1699 MB free, and 1700 MB are needed. Nothing'
nothing "no space for the packages"
disk 9000 649 /var
expect "no space for the archives" 1 'the disk at /var has 649 MB free, and 650 MB are needed'
nothing "no space for the archives"
disk 1700 650 /var
expect "space enough" 0 'about 2 min'
installed "space enough"
disk 1849 9000 /
expect "one disk" 1 'the disk at / has 1849 MB free, and 1850 MB are needed'

fake df 'exit 1'
expect "unknown disks" 0 'about 2 min'
installed "unknown disks"

reset
fake apt-get "case \$* in *'install -y'*--download-only*) ;; *'install -y'*) echo 'E: Sub-process dpkg failed'; exit 100 ;; esac
$plan"
expect "apt fails in the middle" 1 'apt failed \(Sub-process dpkg failed\). What it had begun is removed again'
grep -q '^apt-get .*purge -y g++ cmake libfcl-dev$' "$log" || say "apt fails in the middle" "removes other packages"

reset
fake dpkg-query 'echo installed'
fake g++-11 'case $* in -dumpfullversion) echo 11.4.0 ;; *) echo "g++-11 (Debian 11.4.0-1) 11.4.0" ;; esac'
compiler="ccache g++-11 -m32"
expect "an old compiler by CXX" 1 "$here/bin/g\+\+-11 is version 11.4.0"
compiler="c++ -m32"
expect "a compiler by CXX" 0 ''
unset compiler

# A tool that is too old is named with its place, also where nothing is missing.
for state in 'exit 1' 'echo installed'; do
  reset
  fake dpkg-query "$state"
  fake c++ 'case $* in -dumpfullversion) echo 11.4.0 ;; *) echo "c++ (Debian 11.4.0-1) 11.4.0" ;; esac'
  expect "an old compiler" 1 "$here/bin/c\+\+ is version 11.4.0; Palpate needs 12. .*CXX"
  expect "a set without compiler" 0 '' figures
  reset
  fake dpkg-query "$state"
  fake c++ 'case $* in -dumpfullversion) exit 1 ;; -dumpversion) echo 13.0.1 ;; *) echo "clang version 13.0.1" ;; esac'
  expect "an old clang" 1 "c\+\+ is version 13.0.1; Palpate needs 14"
  reset
  fake dpkg-query "$state"
  fake cmake 'echo "cmake version 3.9.6"; [[ $1 == --version ]]'
  expect "an old CMake" 1 "$here/bin/cmake is version 3.9.6; Palpate needs 3.25"
done
exit $failures
