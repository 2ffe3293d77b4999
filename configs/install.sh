#!/bin/bash
# Builds huetrackd, huetrack and huetrack-calibrate and installs them, with their man pages, shell completion and systemd units: as a
# Debian package, or, with a folder as argument, below that folder.
# It compiles only what it installs.
#   bash configs/install.sh              # the package; remove it with `sudo apt-get remove huetrack`
#   bash configs/install.sh ~/huetrack   # ~/huetrack/bin/huetrackd ...; nothing outside that folder except missing Debian packages
#   bash configs/install.sh --build      # only builds the package, and prints its path
set -euo pipefail
[ $# = 0 ] || [ "$1" = --build ] || to=$(realpath -m "$1")
cd "$(dirname "$0")/.."
. configs/packages.sh

build=build/install
# shellcheck disable=SC2086,SC2154
install_missing $packages_build dpkg-dev
mkdir -p build
echo "== compiling: 9 to 11 minutes of CPU time, so 5 to 6 minutes on two idle cores"
build_huetrack "$build" "-DCMAKE_BUILD_TYPE=Release -DHUETRACK_TESTS=OFF -DHUETRACK_WERROR=OFF" huetrackd huetrack huetrack-calibrate package_documents
if [ -n "${to:-}" ]; then
  cmake --install "$build" --prefix "$to" --strip >/dev/null
  echo "== installed: $to/bin/huetrackd, huetrack and huetrack-calibrate; the configuration is in $to/etc/huetrack"
  exit
fi
rm -f "$build"/huetrack_*.deb
(cd "$build" && cpack >cpack.log) || {
  cat "$build/cpack.log" >&2
  exit 1
}
package=$(realpath "$build"/huetrack_*.deb)
if [ "${1:-}" = --build ]; then
  echo "== built: $package; sudo apt-get install $package installs it"
  exit
fi
sudo=""
[ "$(id -u)" = 0 ] || sudo=sudo
$sudo apt-get install -y -q --reinstall --no-install-recommends "$package"
echo "== installed: huetrackd, huetrack and huetrack-calibrate; the configuration is /etc/huetrack/huetrackd.yaml; begin with: huetrackd setup, or without a camera: huetrackd demo"
