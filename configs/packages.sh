# The Debian packages that huetrack needs, in one place, and how they are installed. Sourced by configs/demo/run.sh and
# tests/run.sh; not a program of its own.

# huetrackd and huetrack (g++: its preprocessor is that of fastddsgen), without the page of `huetrack view`
packages_demo="clang-16 g++ cmake ninja-build pkg-config
  libeigen3-dev libyaml-cpp-dev libfmt-dev libspdlog-dev libcli11-dev
  libsystemd-dev libmicrohttpd-dev nlohmann-json3-dev libsqlite3-dev zlib1g-dev liblz4-dev libzstd-dev libbz2-dev libcairo2-dev fonts-dejavu-core libopencv-dev
  libavformat-dev libavcodec-dev libavutil-dev libswscale-dev libjpeg62-turbo-dev
  libfastrtps-dev libssl-dev fastddsgen default-jre-headless"
# everything: huetrack-calibrate, too, and the page, which is built with node and npm: whichever are there, else Debian's
packages_build="$packages_demo libceres-dev libtomlplusplus-dev libtinyxml2-dev"
command -v npm >/dev/null || packages_build="$packages_build nodejs npm"
packages_test="chromium libgtest-dev libgmock-dev cyclonedds-dev cyclonedds-tools poppler-utils clang-format-14 python3 openssl
  python3-numpy python3-scipy python3-yaml python3-opencv python3-pil ffmpeg"   # the last line: tests/oracle and the scenes that it makes
packages_long="clang-tidy-16"   # HUETRACK_LONG=1 and HUETRACK_CHANGED=1 of tests/run.sh
packages_arm64="g++-aarch64-linux-gnu qemu-user-static"   # configs/arm64/build.sh, tests/arm64/run.sh
packages_benchmark="libbenchmark-dev"   # for -DHUETRACK_BENCHMARKS=ON

# For the VM with real V4L2 drivers (tests/v4l2/run.sh), if its scripts exist; its tests are skipped otherwise.
packages_vm="qemu-system-x86 cpio xz-utils binutils make gcc-12"

# install_missing PACKAGES...: installs missing ones without asking, and prints what it does.
install_missing() {
  local missing="" package sudo=""
  for package in "$@"; do
    [ "$(dpkg-query -W -f='${db:Status-Status}' "$package" 2>/dev/null)" = installed ] || missing="$missing $package"
  done
  [ -n "$missing" ] || return 0
  echo "== installing:$missing"
  if [ "$(id -u)" != 0 ]; then
    if ! command -v sudo >/dev/null; then
      echo "These Debian packages are missing, and neither root nor sudo is at hand. As root, run:" >&2
      echo "  apt-get update && apt-get install --no-install-recommends$missing" >&2
      return 1
    fi
    sudo="sudo"
  fi
  local options="-o Acquire::Retries=3 -o Dpkg::Use-Pty=0 -q"
  # The lists of a fresh system are empty; those of an old one may name versions that are gone: then once more after an update.
  # shellcheck disable=SC2086
  if ! apt-cache show $missing >/dev/null 2>&1 ||
    ! $sudo env DEBIAN_FRONTEND=noninteractive apt-get $options install -y --no-install-recommends $missing </dev/null; then
    echo "== updating the package lists"
    $sudo env DEBIAN_FRONTEND=noninteractive apt-get $options update </dev/null &&
      $sudo env DEBIAN_FRONTEND=noninteractive apt-get $options install -y --no-install-recommends $missing </dev/null || {
      echo "Installing packages failed; see above." >&2
      return 1
    }
  fi
}

# build_huetrack FOLDER "CMAKE OPTIONS" TARGETS...: configures and builds with Ninja; prints the time that it took. In a new
# folder a module's files are compiled together, which halves the time. For development, configure first
# (cmake --preset release): then only changed files are compiled again.
build_huetrack() {
  local folder="$1" options="$2" root start=$SECONDS
  shift 2
  [ -e "$folder/CMakeCache.txt" ] || options="$options -DCMAKE_UNITY_BUILD=ON"
  root="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)"
  echo "== building in $folder"
  # shellcheck disable=SC2086
  cmake -S "$root" -B "$folder" -G Ninja $options -DHUETRACK_VM_TESTS="${HUETRACK_VM_TESTS:-off}" >"$folder.configure.log" 2>&1 || {
    cat "$folder.configure.log" >&2
    return 1
  }
  local TIMEFORMAT="== CPU time: %0lU in programs, %0lS in the system"
  time cmake --build "$folder" --target "$@" || return 1
  echo "== built in $(((SECONDS - start) / 60)) min $(((SECONDS - start) % 60)) s"
}

# build_for_arm64 FOLDER "CMAKE OPTIONS" TARGETS...: on this machine, for a Raspberry Pi or a Jetson. From the top folder.
build_for_arm64() {
  local folder="$1" options="$2"
  shift 2
  # shellcheck disable=SC2086
  install_missing $packages_build $packages_arm64 || return 1
  export HUETRACK_SYSROOT=$PWD/build/arm64-sysroot
  bash configs/arm64/sysroot.sh "$HUETRACK_SYSROOT" || return 1
  HUETRACK_VM_TESTS=off build_huetrack "$folder" \
    "-DCMAKE_BUILD_TYPE=Release -DCMAKE_TOOLCHAIN_FILE=$PWD/configs/arm64/toolchain.cmake $options" "$@"
}
