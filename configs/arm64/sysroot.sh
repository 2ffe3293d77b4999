#!/bin/bash
# Lays out Debian 12's arm64 libraries and headers, as huetrack's build for arm64 needs them.
#   configs/arm64/sysroot.sh FOLDER
# Nothing is installed on this machine: Debian's -dev packages of two architectures exclude one another (OpenCV's do), so
# they are fetched with a list of packages of their own and unpacked. Some 300 MB are fetched, 1 GB is laid out.
set -eu
[ $# = 1 ] || { sed -n 3p "$0" >&2; exit 2; }
. "$(dirname "$0")/../packages.sh"
mkdir -p "$1"
root=$(cd "$1" && pwd)
[ ! -e "$root/complete" ] || exit 0

# Of what is built with, those that are libraries. libblas and liblapack are named so that apt takes no other of their kind.
packages="libc6-dev libstdc++-12-dev libblas-dev liblapack-dev"
# shellcheck disable=SC2154
for package in $packages_build $packages_test $packages_benchmark; do
  case $package in lib*-dev | nlohmann-json3-dev | cyclonedds-dev) packages="$packages $package" ;; esac
done

apt=$root/apt
mkdir -p "$apt/lists/partial" "$apt/archives/partial"
: >"$apt/status"
of_arm64() {
  apt-get -q -o APT::Architecture=arm64 -o APT::Architectures::=arm64 -o Dir::State::lists="$apt/lists" \
    -o Dir::State::status="$apt/status" -o Dir::Cache::archives="$apt/archives" -o Dir::Cache::pkgcache= \
    -o Dir::Cache::srcpkgcache= -o APT::Install-Recommends=false -o APT::Sandbox::User="$(id -un)" "$@"
}
echo "== fetching Debian's arm64 packages into $apt"
of_arm64 update >"$root/apt.log" 2>&1 && of_arm64 install -y --download-only $packages >>"$root/apt.log" 2>&1 || {
  tail -5 "$root/apt.log" >&2
  exit 1
}

rm -rf "$root/usr"
mkdir -p "$root/usr/lib" "$root/usr/bin" "$root/usr/sbin"
for folder in lib bin sbin; do ln -sfn usr/$folder "$root/$folder"; done
for archive in "$apt"/archives/*.deb; do
  dpkg-deb --fsys-tarfile "$archive" |
    tar -x --keep-directory-symlink -C "$root" --exclude=./usr/share/doc --exclude=./usr/share/man --exclude=./usr/share/locale
done
# What the packages' own scripts would do, and what names a place from the root on.
find "$root/usr" "$root/etc" -lname '/*' -printf '%p\t%l\n' | while IFS=$'\t' read -r link target; do
  ln -sfn "$(realpath -sm --relative-to="$(dirname "$link")" "$root$target")" "$link"
done
lib=$root/usr/lib/aarch64-linux-gnu
for name in blas lapack; do
  for file in "$lib/$name/lib$name".so*; do ln -sfn "$name/$(basename "$file")" "$lib/$(basename "$file")"; done
done
grep -rlE '[";]/usr[/"]' "$lib/cmake" "$root/usr/share/cmake" "$root/usr/lib/cmake" 2>/dev/null | while read -r file; do
  sed -i -E "s#([\";])/usr([/\"])#\1$root/usr\2#g" "$file"
done
# Which package each library is of.
for archive in "$apt"/archives/*.deb; do
  package=$(dpkg-deb -f "$archive" Package)
  dpkg-deb --fsys-tarfile "$archive" | tar -t | sed -n "s#.*/\\(lib[^/]*\\.so\\.[0-9.]*\\)\$#\\1 $package#p"
done >"$root/libraries"
touch "$root/complete"
