#!/bin/bash
# Installs what is missing, builds everything, runs every test. The last line counts them: N passed, N failed, N skipped.
# Exit status: 0 only when at least one test passed and none failed.
set -uo pipefail
cd "$(dirname "$0")/.."
. configs/packages.sh

build=build/release
results=$PWD/$build/tests.xml
fail() {
  echo "$1" >&2
  echo "0 passed, 0 failed, 0 skipped"
  exit 1
}

# shellcheck disable=SC2086
install_missing $packages_build $packages_test || fail "the packages could not be installed"
# off, short (3 minutes) or all (15): real V4L2 drivers in a VM (tests/v4l2/run.sh); skipped where there is no VM.
export HUETRACK_VM_TESTS=${HUETRACK_VM_TESTS:-short}
if [ "$HUETRACK_VM_TESTS" != off ] && [ -d "${V4L2VM_DIR:-../shared/tools/v4l2vm}" ]; then
  # shellcheck disable=SC2086,SC2154
  install_missing $packages_vm || echo "no VM, so its tests will be skipped"
fi
mkdir -p build
build_huetrack "$build" ON all || fail "the build failed"

rm -f "$results"
ctest --test-dir "$build" -j2 --output-on-failure --output-junit "$results"
ctest_status=$?
[ -s "$results" ] || fail "ctest wrote no results"

# The root element: <testsuite name=... tests="N" failures="N" disabled="N" skipped="N" ...>
count() { tr '\n\t' '  ' <"$results" | sed -n "s/.*<testsuite [^>]*[ ]$1=\"\([0-9]*\)\".*/\1/p"; }
total=$(count tests) failed=$(count failures) disabled=$(count disabled) skipped=$(count skipped)
[ -n "$total" ] && [ -n "$failed" ] && [ -n "$disabled" ] && [ -n "$skipped" ] || fail "the results of ctest cannot be read: $results"
skipped=$((skipped + disabled))
passed=$((total - failed - skipped))
echo "$passed passed, $failed failed, $skipped skipped"
[ "$passed" -gt 0 ] && [ "$failed" -eq 0 ] && [ "$ctest_status" -eq 0 ]
