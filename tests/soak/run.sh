#!/bin/bash
# The soak: the service on three failing cameras (stalled, absent, damaged, missing frames, jumping clocks) for a long time,
# with reloads, pre-rolls, a full disk, teaching, subscribers, readers of its metrics and pages. Outside the CI.
#   tests/soak/run.sh [--minutes N] [--sanitizer none|address|thread] [--seed N]      60 minutes
# Prints its memory as it goes. Exit status 0: it never stopped, its watchdog was always fed, its memory is flat (none) and
# the page bridge's is, and the sanitizer found nothing.
set -euo pipefail
cd "$(dirname "$0")/../.."
minutes=60 sanitizer=none seed=1
while [ $# -gt 0 ]; do
  case $1 in
    --minutes) minutes=$2 ;;
    --sanitizer) sanitizer=$2 ;;
    --seed) seed=$2 ;;
    *)
      sed -n '2,6s/^# \{0,1\}//p' "$0" >&2
      exit 2
      ;;
  esac
  shift 2
done
case $sanitizer in
  none) preset=release slowness=1 ;;
  address) preset=asan slowness=5 ;;
  thread) preset=tsan slowness=10 ;;
  *)
    echo "--sanitizer is none, address or thread" >&2
    exit 2
    ;;
esac
for one in release "$preset"; do cmake --preset "$one" >/dev/null; done
nice cmake --build build/release --target soak huetrack
nice cmake --build "build/$preset" --target film_service   # only the service is sanitized
export ASAN_OPTIONS=detect_leaks=1:halt_on_error=1 UBSAN_OPTIONS=print_stacktrace=1:halt_on_error=1
export TSAN_OPTIONS=halt_on_error=1:second_deadlock_stack=1:suppressions=$PWD/tests/tsan.supp
# The disk that is full now and then is a tmpfs in a mount namespace of its own.
own_namespace=(unshare --mount)
[ "$(id -u)" = 0 ] || own_namespace=(unshare --user --map-root-user --mount)
exec "${own_namespace[@]}" build/release/tests/soak/soak --minutes "$minutes" --seed "$seed" --slowness "$slowness" \
  --service "build/$preset/tests/soak/film_service"
