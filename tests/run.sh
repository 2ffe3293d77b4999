#!/bin/bash
# Installs what is missing, builds everything, runs every test. The last line counts them: N passed, N failed, N skipped.
# Exit status: 0 only when at least one test passed and none failed.
#   HUETRACK_LONG=1              builds everything once more with -O0, AddressSanitizer and UBSan (preset debug; what computes
#                                with -O2, or single tests take ten minutes), runs the tests of all modules there, and
#                                clang-tidy over the tree; then what has threads with ThreadSanitizer; then for arm64
#                                (tests/arm64/run.sh); over three hours on two cores. 2: what computes with -O0, too; two
#                                hours more
#   HUETRACK_CHANGED=1           in addition: tests with AddressSanitizer and UBSan of the modules that changed since the last tag
#                                (without a tag: of a third of all, another one with each commit), and clang-tidy over changed
#                                files for at most five minutes (tests/changed.sh)
#   HUETRACK_VM_TESTS=off|short|all   real V4L2 drivers in a VM (tests/v4l2/run.sh; short: 3 minutes, all: 15); skipped
#                                where there is no VM
set -uo pipefail
cd "$(dirname "$0")/.."
. configs/packages.sh

build=build/release
fail() {
  echo "$1" >&2
  echo "0 passed, 0 failed, 0 skipped"
  exit 1
}

# shellcheck disable=SC2086
install_missing $packages_build $packages_test || fail "the packages could not be installed"
export HUETRACK_VM_TESTS=${HUETRACK_VM_TESTS:-short}
if [ "$HUETRACK_VM_TESTS" != off ] && [ -d "${V4L2VM_DIR:-../shared/tools/v4l2vm}" ]; then
  # shellcheck disable=SC2086,SC2154
  install_missing $packages_vm || echo "no VM, so its tests will be skipped"
fi
long=${HUETRACK_LONG:-0}
if [ "$long" != 0 ]; then
  # shellcheck disable=SC2086,SC2154
  install_missing $packages_long || fail "the packages could not be installed"
fi
mkdir -p build
build_huetrack "$build" "-DCMAKE_BUILD_TYPE=Release" all || fail "the build failed"

total=0 failed=0 skipped=0 status=0
# run_tests FOLDER CTEST-ARGUMENTS...: adds to the counts; prints the output of failed tests once more at the end
run_tests() {
  local folder="$1" results="$PWD/$1/tests.xml" count
  shift
  rm -f "$results"
  ctest --test-dir "$folder" --output-on-failure --output-junit "$results" "$@" || status=1
  read -r -a count < <(/usr/bin/python3 tests/results.py "$results")
  [ ${#count[@]} = 3 ] || fail "the results of ctest cannot be read: $results"
  total=$((total + count[0])) failed=$((failed + count[1])) skipped=$((skipped + count[2]))
}

run_tests "$build" -j4   # half cores: tests/CMakeLists.txt
if [ "${HUETRACK_CHANGED:-0}" != 0 ]; then
  # shellcheck disable=SC2086,SC2154
  install_missing $packages_long || fail "the packages could not be installed"
  cmake --preset asan -DCMAKE_UNITY_BUILD=ON -DCMAKE_CXX_FLAGS_RELWITHDEBINFO="-O1 -g1" >/dev/null ||
    fail "the build with AddressSanitizer could not be configured"
  changed=$(bash tests/changed.sh modules) || fail "git does not say what changed"
  if [ -n "$changed" ]; then
    echo "== with AddressSanitizer and UBSan:" $changed
    # shellcheck disable=SC2086
    build_huetrack build/asan "" $(printf 'tests/%s/all ' $changed) || fail "the build with AddressSanitizer failed"
    export LSAN_OPTIONS=suppressions=$PWD/tests/lsan.supp
    for module in $changed; do run_tests "build/asan/tests/$module" -j4; done
  fi
  bash tests/changed.sh tidy 300 || status=1
fi
if [ "$long" != 0 ]; then
  fast=ON
  [ "$long" != 2 ] || fast=OFF
  cmake --preset debug -DHUETRACK_FAST_NUMERICS=$fast >/dev/null || fail "the debug build could not be configured"
  build_huetrack build/debug "" all || fail "the debug build failed"
  export LSAN_OPTIONS=suppressions=$PWD/tests/lsan.supp
  # Not those that measure time, or need a browser or a VM: they run whole programs, which are the same as above.
  run_tests build/debug -j4 -E '^(end_to_end\.|browser/|v4l2/|floors/|fences/|format$)'
  cmake --preset tsan -DCMAKE_UNITY_BUILD=ON >/dev/null || fail "the build with ThreadSanitizer could not be configured"
  threaded="capture recordings hosts pipeline publish client live_view page metrics daemon gather solver program keyframes
            camera_tracking"
  # shellcheck disable=SC2086
  build_huetrack build/tsan "" $(printf 'tests/%s/all ' $threaded) || fail "the build with ThreadSanitizer failed"
  export TSAN_OPTIONS=suppressions=$PWD/tests/tsan.supp:second_deadlock_stack=1
  for module in $threaded; do run_tests "build/tsan/tests/$module" -j1; done
  build_for_arm64 build/arm64-tests "" all || fail "the build for arm64 failed"
  mapfile -t of_arm64 < <(bash tests/arm64/run.sh --which)
  run_tests build/arm64-tests -j4 "${of_arm64[@]}"
fi

passed=$((total - failed - skipped))
echo "$passed passed, $failed failed, $skipped skipped"
[ "$passed" -gt 0 ] && [ "$failed" -eq 0 ] && [ "$status" -eq 0 ]
