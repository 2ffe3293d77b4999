#!/bin/bash
# Builds for arm64 and runs the tests of the modules there, by qemu-user: kernels on NEON held to the plain reference, and
# what computes and reads. Not run: what qemu-user cannot do (V4L2, what DDS asks of the network), and what computes for
# minutes already on this machine (it takes ten to twenty times as long). Part of HUETRACK_LONG=1 of tests/run.sh.
#   tests/arm64/run.sh [CTEST-ARGUMENTS...]
#   tests/arm64/run.sh --which      which tests are run, for ctest's -R and -E
set -euo pipefail
cd "$(dirname "$0")/../.."
modules='color|color_teaching|particle_filter|outline|object_tracking|objects|trackers|model|yaml|drawing|truth|tracks|metrics|reports|exchange'
modules="$modules|config|scene|capture|recordings|room_watch|view_watch|pictures|plot|bag"
which=(-R "^($modules)\\." -E 'V4l2')
if [ "${1:-}" = --which ]; then
  printf '%s\n' "${which[@]}"
  exit
fi
. configs/packages.sh
build_for_arm64 build/arm64-tests "" all
ctest --test-dir build/arm64-tests --output-on-failure "${which[@]}" "${@:--j4}"
