#!/bin/bash
# Builds huetrack's Debian package for arm64 (Raspberry Pi, Jetson) on this machine: build/arm64/huetrack_*_arm64.deb.
#   configs/arm64/build.sh
set -euo pipefail
cd "$(dirname "$0")/../.."
. configs/packages.sh
folder=build/arm64
build_for_arm64 "$folder" -DHUETRACK_TESTS=OFF all

# What it needs there: the packages that the libraries which the programs name came from. (dpkg-shlibdeps, which says so
# of this machine's own, asks only what is installed here.)
depends=$(find "$folder" -maxdepth 4 -type f -name 'huetrack*' -perm -u+x ! -name '*.so*' -exec aarch64-linux-gnu-readelf -d {} + |
  sed -n 's/.*(NEEDED).*\[\(.*\)\]/\1/p' | sort -u |
  while read -r library; do grep -m1 "^$library " "$HUETRACK_SYSROOT/libraries" | cut -d' ' -f2; done | sort -u | paste -sd, | sed 's/,/, /g')
[ -n "$depends" ] || {
  echo "no program was built in $folder" >&2
  exit 1
}
rm -f "$folder"/huetrack_*.deb
(cd "$folder" && cpack -D CPACK_DEBIAN_PACKAGE_ARCHITECTURE=arm64 -D CPACK_DEBIAN_PACKAGE_SHLIBDEPS=OFF \
  -D CPACK_DEBIAN_PACKAGE_DEPENDS="$depends" >cpack.log) || {
  cat "$folder/cpack.log" >&2
  exit 1
}
echo "== built: $(realpath "$folder"/huetrack_*.deb); on the other machine: sudo apt-get install ./huetrack_*.deb"
