#!/bin/bash
# Camera hosts in network namespaces, each with its own address on a bridge, and a tracker in another: how many frames come
# through, and what happens when a host is killed, and when its cable is pulled. As root.
#   tests/hosts/namespaces.sh [--hosts N] [--cameras PER_HOST] [--seconds S] [--format mjpeg|yuyv]      8, 2, 20, mjpeg
# Needs a build in build/release (targets film_host, huetrackd, huetrack). Exit status 77: not allowed here.
set -eu
cd "$(dirname "$0")/../.."
hosts=8 cameras=2 seconds=20 format=mjpeg
while [ $# -gt 0 ]; do
  case $1 in
    --hosts) hosts=$2; shift 2 ;;
    --cameras) cameras=$2; shift 2 ;;
    --seconds) seconds=$2; shift 2 ;;
    --format) format=$2; shift 2 ;;
    *) sed -n 2,5p "$0"; exit 2 ;;
  esac
done
build=$PWD/build/release
if [ "$(id -u)" != 0 ] || ! ip netns add ht-try 2>/dev/null; then
  echo "SKIP: network namespaces need root, and a kernel that has them"
  exit 77
fi
ip netns del ht-try

out=$(mktemp -d)
all=$((hosts * cameras))
clean() {
  for pid in $(jobs -p); do kill -9 "$pid" 2>/dev/null || true; done
  { wait || true; } 2>/dev/null
  for n in $(seq 0 "$hosts"); do ip netns del "ht-$n" 2>/dev/null || true; done
  ip link del ht-bridge 2>/dev/null || true
  rm -rf "$out"
}
trap clean EXIT
ip link add ht-bridge type bridge
ip link set ht-bridge up
for n in $(seq 0 "$hosts"); do   # 0 is the tracker's
  ip netns add "ht-$n"
  ip link add "ht-b$n" type veth peer name eth0 netns "ht-$n"
  ip link set "ht-b$n" master ht-bridge up
  ip -n "ht-$n" addr add "10.77.0.$((n + 1))/24" dev eth0
  ip -n "ht-$n" link set eth0 up
  ip -n "ht-$n" link set lo up
  ip -n "ht-$n" route add default dev eth0   # for multicast
done

echo "== $hosts hosts x $cameras cameras of 640x480 at 30 fps, $format"
"$build/tests/soak/film_host" --make "$all" "$out/films"
{
  echo "version: 1"
  echo "rig: $out/films/rig.yaml"
  echo "targets: {lime: {color: {hue_deg: [65, 115]}}}"
  echo "dds: {domain: 77}"
  echo "cameras:"
  for c in $(seq 0 $((all - 1))); do echo "  cam$c: {host: host-$((c / cameras + 1)), camera: cam$c}"; done
} >"$out/tracker.yaml"
host() {   # N
  {
    echo "version: 1"
    echo "host: host-$1"
    echo "dds: {domain: 77}"
    echo "cameras:"
    for c in $(seq $((($1 - 1) * cameras)) $(($1 * cameras - 1))); do
      echo "  cam$c: {device: /dev/film/cam$c, size: [640, 480], format: $format, fps: 30}"
    done
  } >"$out/host-$1.yaml"
  ip netns exec "ht-$1" "$build/tests/soak/film_host" "$out/films" "$out/host-$1.yaml" >"$out/host-$1.log" 2>&1 &
}
for n in $(seq 1 "$hosts"); do host "$n"; eval "pid_$n=$!"; done
ip netns exec ht-0 "$build/service/daemon/huetrackd" run "$out/tracker.yaml" --tracks "$out/tracks.csv" >"$out/tracker.log" 2>&1 &
tracker=$!
sleep 6
status() { ROS_DOMAIN_ID=77 ip netns exec ht-0 timeout 5 "$build/clients/huetrack/huetrack" status 2>&1 || true; }
sleep "$seconds"
status >"$out/status.1"
echo "-- status"
cat "$out/status.1"
echo "== a host is killed with -9, and started again after 5 s"
# shellcheck disable=SC2154
kill -9 "$pid_1"
sleep 5
host 1
sleep 6
echo "== its cable is pulled for 10 s"
ip link set ht-b1 down
sleep 10
ip link set ht-b1 up
sleep 6
kill -INT "$tracker"
wait "$tracker" || true
echo "-- the tracker's log"
cat "$out/tracker.log"
