#!/bin/bash
# From a clean clone to the first DDS sample: installs missing packages, builds, and replays the bundled recording at its real
# speed, while a second process, `huetrack watch`, prints the positions that arrive over DDS.
set -euo pipefail
cd "$(dirname "$0")/../.."
. configs/packages.sh

build=build/demo
out=out/demo
recording=configs/demo/recording

# shellcheck disable=SC2086
install_missing $packages_demo
mkdir -p build
# Without parts that it does not run: tests, calibration, page, camera tracker.
build_huetrack "$build" "-DCMAKE_BUILD_TYPE=Release -DHUETRACK_TESTS=OFF -DHUETRACK_WERROR=OFF -DHUETRACK_CALIBRATE=OFF -DHUETRACK_PAGE=OFF
  -DHUETRACK_CAMERA_TRACKER=OFF" huetrackd huetrack
huetrackd=$build/service/daemon/huetrackd
huetrack=$build/clients/huetrack/huetrack

rm -rf "$out"
mkdir -p "$out"
subscribers=""
# shellcheck disable=SC2086
trap '[ -z "$subscribers" ] || kill $subscribers 2>/dev/null || true' EXIT

echo
echo "== replaying $recording at its real speed; huetrack watch receives over DDS:"
# One subscriber prints for people; the second logs to a file, which is compared with the truth below.
"$huetrack" watch > >(tee "$out/watch.txt") &
subscribers="$!"
"$huetrack" log "$out/received.csv" 2>"$out/log.txt" &
subscribers="$subscribers $!"

"$huetrackd" replay configs/demo/huetrackd.yaml "$recording" --speed real --wait-for-subscriber 10 --subscribers 2 \
  --tracks "$out/tracks.csv" --truth "$recording/groundtruth.csv" --pictures "$out/pictures" --pictures-every 10 \
  >"$out/replay.txt" 2>"$out/replay.log" || {
  cat "$out/replay.log" >&2
  exit 1
}
sleep 0.5 # for the last samples
# shellcheck disable=SC2086
kill $subscribers 2>/dev/null || true
# shellcheck disable=SC2086
wait $subscribers 2>/dev/null || true
subscribers=""
sleep 0.2 # for tee

sent=$(($(wc -l <"$out/tracks.csv") - 1))
printed=$(grep -c . "$out/watch.txt" || true)
offset=$(sed -n "s/.*published capture times are the recording's plus \([0-9.-]*\) s.*/\1/p" "$out/replay.txt")
received=$("$huetrackd" compare "$out/received.csv" "$recording/groundtruth.csv" --clock-offset "$offset")

echo
echo "== summary of huetrackd"
cat "$out/replay.txt"
echo
echo "== the received stream"
echo "  $printed of $sent samples arrived at huetrack watch"
echo "  compared with the truth: $received"
echo
echo "== pictures"
echo "  every view with the particles and the estimate: $(find "$out/pictures" -name 'set_*.png' | wc -l) files $out/pictures/set_*.png"
echo "  the track in 3-D with the truth:                $out/pictures/track_3d.png"
[ "$printed" -gt 0 ] || { echo "No sample arrived: see $out/replay.log" >&2; exit 1; }
echo
echo "== next: bash configs/install.sh builds all three programs (huetrack-calibrate and the live page, too) and installs them;"
echo "   then huetrackd demo plays this recording as if it were live, with the page on it: teach, record, calibrate"
