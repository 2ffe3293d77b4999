#!/bin/bash
# Hashes of what the programs make of every shared recording: tracks, poses, rigs. For a change that must not move anything:
# run it before and after, and compare.
#   tests/benchmark/track_hashes.sh [BUILD] >before.txt      BUILD: the build folder, build/release if left out
set -euo pipefail
cd "$(dirname "$0")/../.."
build=${1:-build/release}
huetrackd=$build/service/daemon/huetrackd
calibrate=$build/calib/program/huetrack-calibrate
data=$(cd ../shared/data && pwd) || { echo "../shared/data is not there" >&2; exit 1; }
rendered=$data/rendered
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# hash_of NAME FILE: one line of the list. The lines of a rig that say when and by what it was made do not count.
hash_of() {
  echo "$1 $(grep -vE 'date|tool|made_by|^ +at:' "$2" | sha256sum | cut -c1-16)"
}
# replay NAME KIND(tracks|poses) RECORDING ARGUMENTS...: with the configuration $work/c.yaml or the one given by config=
replay() {
  local name=$1 kind=$2 recording=$3
  shift 3
  rm -f "$work/out"  # of another kind: no output replaces it
  "$huetrackd" replay "${config:-$work/c.yaml}" "$recording" --no-dds --quiet "--$kind" "$work/out" "$@" >"$work/log" 2>&1 ||
    { cat "$work/log" >&2; exit 1; }
  hash_of "$name" "$work/out"
}

pink='pink: {radius_m: 0.04, color: {hue_deg: [310, 355]}}'
lime='lime: {radius_m: 0.04, color: {hue_deg: [65, 115]}}'
room='volume: {min: [-1, -1, 0.1], max: [1, 1, 2.1]}'
# configure RIG TARGETS TRACKING
configure() {
  printf 'version: 1\nrig: %s\ntargets: {%s}\nobject_tracking: {%s}\n' "$1" "$2" "$3" >"$work/c.yaml"
}
for filter in huetrack paper; do
  for case in "two_cams|$lime" "occlusion|$pink, $lime" "fast_60fps|$pink"; do
    name=${case%%|*}
    configure "$rendered/$name/rig.yaml" "${case#*|}" "observation: $filter, $room"
    for threads in 1 2; do replay "$name.$filter.$threads" tracks "$rendered/$name" --threads $threads; done
  done
  configure "$data/red_square_stereo/rig.yaml" \
    'red: {radius_m: 0.0085, color: {hue_deg: [340, 358], saturation: [0.6, 1], intensity: [0.08, 0.4]}, camera_colors: {cam2: {hue_deg: [335, 356], saturation: [0.22, 0.6], intensity: [0.25, 0.6]}}}' \
    "observation: $filter, volume: {min: [-0.3, -0.2, -1.2], max: [0.4, 0.5, -0.3]}, pixel_noise_px: 1.4"
  replay "red_square.$filter" tracks "$data/red_square_stereo"
done
for name in webcams webcams_wave juggling swarm_public bumped; do
  config=$rendered/$name/huetrackd.yaml replay "$name" tracks "$rendered/$name"
done

# configure_camera RIG METHOD START
configure_camera() {
  printf 'version: 1\nrig: %s\ncamera_tracking: {camera: cam0, method: %s, start: {%s}}\n' "$1" "$2" "$3" >"$work/c.yaml"
}
for method in huetrack pupilli lee; do
  configure_camera "$rendered/desk/rig.yaml" $method "rectangle: $rendered/desk/rectangle.csv"
  replay "desk.$method" poses "$rendered/desk"
done
for method in huetrack herranz; do
  configure_camera "$rendered/leds/rig.yaml" $method \
    "leds: $rendered/leds/led_positions.csv, led_schedule: $rendered/leds/led_frames.csv"
  replay "leds.$method" poses "$rendered/leds"
done
configure_camera "$data/hand_held_7scenes/rig.yaml" huetrack "points: $data/hand_held_7scenes/start_points.csv"
replay hand_held_7scenes poses "$data/hand_held_7scenes"

# Ends with 2 where the result is doubtful: then the rig is there all the same.
"$calibrate" extrinsics --quiet --board "$rendered/chessboard/board.yaml" "$rendered/chessboard" --rig "$work/board.yaml" \
  >"$work/log" 2>&1 || [ $? = 2 ]
hash_of chessboard "$work/board.yaml"
"$calibrate" wave "$rendered/webcams_wave" --config "$rendered/webcams_wave/huetrackd.yaml" --target ball \
  --rig "$work/wave.yaml" >"$work/log" 2>&1 || [ $? = 2 ]
hash_of wave "$work/wave.yaml"
