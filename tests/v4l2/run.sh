#!/bin/bash
# Runs the test of the V4L2 devices in a small VM that has some: v4l2loopback, vivid, and USB cameras through uvcvideo.
#   tests/v4l2/run.sh [PROGRAM [GTEST_ARGUMENTS...]]     PROGRAM: v4l2_devices_test of a build (default build/release)
# The VM's scripts are looked for in ../shared/tools/v4l2vm (V4L2VM says otherwise); its files are cached in
# $V4L2VM_CACHE (default ~/.cache/v4l2vm). Exit status 77: skipped, because the VM cannot be had here.
set -euo pipefail
root=$(cd "$(dirname "$0")/../.." && pwd)
vm=${V4L2VM_DIR:-$root/../shared/tools/v4l2vm}
program=${1:-$root/build/release/tests/v4l2/v4l2_devices_test}
shift || true

skip() {
  echo "SKIPPED: $1"
  exit 77
}
[ "${HUETRACK_VM_TESTS:-1}" != 0 ] || skip "configure with -DHUETRACK_VM_TESTS=ON, or run tests/v4l2/run.sh"
[ -x "$vm/v4l2vm.sh" ] || skip "no VM in $vm"
command -v qemu-system-x86_64 >/dev/null || skip "no qemu: apt-get install --no-install-recommends qemu-system-x86 cpio xz-utils binutils make gcc-12"
[ -x "$program" ] || { echo "$program: not built (cmake --build BUILD --target v4l2_devices_test)" >&2; exit 1; }

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
tools=$work/tools
mkdir "$tools"
for tool in v4l2play uvccam; do gcc -O2 -w -pthread -o "$tools/$tool" "$vm/tools/$tool.c"; done
# the same camera with another serial number: another one in its port
sed 's/EMU%04d/XMU%04d/' "$vm/tools/uvccam.c" >"$work/uvccam_other.c"
gcc -O2 -w -pthread -o "$tools/uvccam_other" "$work/uvccam_other.c"

"$vm/v4l2vm.sh" --prepare || skip "the VM cannot be prepared (see above)"
start=$SECONDS
status=0
"$vm/v4l2vm.sh" --vivid 2 --loopback 1 --uvc --timeout 280 --out "$work/out" --env "HUETRACK_V4L2_TOOLS=$tools" \
  --env "ASAN_OPTIONS=${ASAN_OPTIONS:-}" -- "$(realpath "$program")" --gtest_color=no "$@" || status=$?
[ "$status" = 0 ] || tail -15 "$work/out/console.log"
echo "v4l2/run.sh: $((SECONDS - start)) s in the VM, status $status"
exit "$status"
