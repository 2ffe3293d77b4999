#!/bin/bash
# Tests the capture and the whole daemon in a small VM with real V4L2 drivers: v4l2loopback, vivid, and USB cameras through
# uvcvideo.
#   tests/v4l2/run.sh [--all | --short] [BUILD [GTEST_ARGUMENTS...]]
# --all (the default) takes about a quarter of an hour, --short some three; tests/run.sh has the short form among its tests
# (HUETRACK_VM_TESTS=off or all says otherwise). BUILD: where v4l2_devices_test and the others were built (default
# build/release). The VM's scripts are looked for in ../shared/tools/v4l2vm (V4L2VM_DIR says otherwise); its files are cached
# in $V4L2VM_CACHE (default ~/.cache/v4l2vm). Exit status 77: skipped, because the VM cannot be had here, with the reason.
set -euo pipefail
root=$(cd "$(dirname "$0")/../.." && pwd)
vm=${V4L2VM_DIR:-$root/../shared/tools/v4l2vm}
filter='*' patience=1500
case ${1:-} in
  --all) shift ;;
  --off)
    echo "SKIPPED: configure with -DHUETRACK_VM_TESTS=short or all, or run tests/v4l2/run.sh"
    exit 77
    ;;
  --short)
    patience=600 filter='Loopback.FramesAreBitExact*:Uvc.ManualValues*:Uvc.UnplugAnotherAndReplug:Vivid.FlaggedFrames*:Vivid.ABusyCamera*:Rendered/Films.*/two_cams:Webcams.TheTrack*:Webcams.Doctor*:Faults.*'
    shift
    ;;
esac
build=$(realpath "${1:-$root/build/release}")
shift || true

skip() {
  echo "SKIPPED: $1"
  exit 77
}
[ -x "$vm/v4l2vm.sh" ] || skip "no VM in $vm"
[ "$(uname -m)" = x86_64 ] || skip "the VM is for x86_64, this is $(uname -m)"
for program in qemu-system-x86_64 cpio xz strip make gcc-12; do
  command -v "$program" >/dev/null ||
    skip "no $program: apt-get install --no-install-recommends qemu-system-x86 cpio xz-utils binutils make gcc-12"
done
for test in devices daemon calibration; do
  [ -x "$build/tests/v4l2/v4l2_${test}_test" ] || {
    echo "$build/tests/v4l2/v4l2_${test}_test: not built (cmake --build $build --target v4l2_${test}_test)" >&2
    exit 1
  }
done

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
tools=$work/tools
mkdir "$tools"
gcc-12 -O2 -w -pthread -o "$tools/v4l2play" "$vm/tools/v4l2play.c"
gcc-12 -O2 -shared -fPIC -o "$tools/locked_up.so" "$root/tests/v4l2/locked_up.c"
# cameras of several programs: each in a port of its own, and with its number
sed -e 's/"EMU%04d", c->i/"EMU%04d", c->i + PORT/' -e 's/"%d %d %d %d", n, sv/"%d %d %d %d", n + PORT, sv/' \
  "$vm/tools/uvccam.c" >"$work/uvccam.c"
[ "$(grep -c PORT "$work/uvccam.c")" = 2 ] || { echo "$vm/tools/uvccam.c is not the one that this was written for" >&2; exit 1; }
uvccam() { gcc-12 -O2 -w -pthread '-DPORT=(getenv("UVCCAM_PORT") ? atoi(getenv("UVCCAM_PORT")) : 0)' -o "$tools/$1" "$work/$1.c"; }
uvccam uvccam
# the same camera with another serial number: another one in its port
sed 's/EMU%04d/XMU%04d/' "$work/uvccam.c" >"$work/uvccam_other.c"
uvccam uvccam_other

"$vm/v4l2vm.sh" --prepare || skip "the VM cannot be prepared: its kernel or modules cannot be had (see above)"
free_mb=$(awk '/^MemAvailable:/ { print int($2 / 1024) }' /proc/meminfo)
[ "$free_mb" -ge 2500 ] || skip "the VM takes 2 GB of memory, and only $free_mb MB are free"
start=$SECONDS
status=0
# shellcheck disable=SC2016
"$vm/v4l2vm.sh" --vivid 2 --loopback 3 --uvc --timeout "$patience" --out "$work/out" --env "HUETRACK_V4L2_TOOLS=$tools" \
  --env "ASAN_OPTIONS=${ASAN_OPTIONS:-}" --env "HUETRACK_KILLS=${HUETRACK_KILLS:-20}" -- \
  sh -c 'touch /out/started; cd /tmp; ip link set lo up 2>/dev/null; build=$1; filter=$2; shift 2; status=0
    for test in devices daemon calibration; do
      "$build/tests/v4l2/v4l2_${test}_test" --gtest_color=no --gtest_filter="$filter" "$@" || status=1
    done
    exit $status' sh "$build" "$filter" "$@" || status=$?
if [ "$status" != 0 ]; then
  [ ! -e "$work/out/console.log" ] || tail -15 "$work/out/console.log"
  [ -e "$work/out/started" ] || skip "the VM did not come up (status $status, see above)"
fi
echo "v4l2/run.sh: $((SECONDS - start)) s in the VM, status $status"
exit "$status"
