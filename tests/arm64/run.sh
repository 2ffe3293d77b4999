#!/bin/bash
# Builds for arm64 and runs the tests of the modules there, by qemu-user: kernels on NEON held to the plain reference,
# and all the rest. Some 40 minutes on two cores; part of HUETRACK_LONG=1 of tests/run.sh.
#   tests/arm64/run.sh [CTEST-ARGUMENTS...]
#   tests/arm64/run.sh --left-out      which tests are not run
set -euo pipefail
cd "$(dirname "$0")/../.."
# Those that measure time, or need a browser, a VM or a camera: emulated all is ten times slower.
left_out='^(end_to_end\.|browser/|v4l2|floors/|fences/|format$|soak|fuzz|hosts\.|daemon\.Live)'
if [ "${1:-}" = --left-out ]; then
  echo "$left_out"
  exit
fi
. configs/packages.sh
build_for_arm64 build/arm64-tests "" all
ctest --test-dir build/arm64-tests --output-on-failure -E "$left_out" "${@:--j4}"
