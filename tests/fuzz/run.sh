#!/bin/bash
# Fuzzes every reader of files and of the network: builds the targets with clang, and runs each for so long.
#   tests/fuzz/run.sh [--minutes N] [--jobs N] [TARGET...]      10 minutes, 1 job, all targets
# Prints of each how often it ran, and how many of the readers' edges were reached. What ends a target is kept in
# build/fuzz/findings, and what reached more in build/fuzz/corpus: worth its place in tests/fuzz/corpus when it is small.
# Needs clang-14 and libclang-rt-14-dev, and a build in build/release (targets all, fuzz_test).
set -eu
cd "$(dirname "$0")/../.."
minutes=10 jobs=1 names=()
while [ $# -gt 0 ]; do
  case $1 in
    --minutes) minutes=$2; shift 2 ;;
    --jobs) jobs=$2; shift 2 ;;
    -*) sed -n 2,7p "$0"; exit 2 ;;
    *) names+=("$1"); shift ;;
  esac
done
[ ${#names[@]} -gt 0 ] || for file in tests/fuzz/targets/*.cpp; do names+=("$(basename "$file" .cpp)"); done

out=build/fuzz
mkdir -p $out/findings $out/logs
HUETRACK_WRITE_SEEDS=$PWD/$out/seeds build/release/tests/fuzz/fuzz_test --gtest_filter='*Seeds*' >$out/logs/seeds 2>&1 ||
  { cat $out/logs/seeds; exit 1; }
CC=clang-14 CXX=clang++-14 cmake -S tests/fuzz/clang -B $out/clang -G Ninja -DCMAKE_BUILD_TYPE=None >$out/logs/cmake
nice ninja -C $out/clang -j"$jobs" $(printf 'fuzz_%s ' "${names[@]}") >$out/logs/build || { tail -50 $out/logs/build; exit 1; }

status=0
printf '%-10s %12s %10s %18s  %s\n' target executions per_second edges_reached result
for name in "${names[@]}"; do
  mkdir -p $out/corpus/"$name"
  more=()
  [ -d tests/fuzz/corpus/"$name" ] && more=(tests/fuzz/corpus/"$name")
  # A server's threads keep what they have not freed yet: the look for leaks after each request takes most of the time.
  [ "$name" != http ] || more+=(-detect_leaks=0)
  log=$out/logs/$name result=nothing\ found
  nice $out/clang/fuzz_"$name" -max_total_time="$(awk "BEGIN { print int(60 * $minutes) }")" -timeout=20 -rss_limit_mb=3000 -max_len=200000 \
    -print_final_stats=1 -artifact_prefix=$out/findings/"$name"- \
    $out/corpus/"$name" $out/seeds/"$name" "${more[@]}" >"$log" 2>&1 || { result="FOUND, see $log"; status=1; }
  runs=$(sed -n 's/^stat::number_of_executed_units: *//p' "$log")
  rate=$(sed -n 's/^stat::average_exec_per_sec: *//p' "$log")
  edges=$(sed -n 's/.*INFO: Loaded 1 modules *(\([0-9]*\) .*/\1/p' "$log" | head -1)
  reached=$(sed -n 's/.* cov: \([0-9]*\) .*/\1/p' "$log" | tail -1)
  printf '%-10s %12s %10s %9s of %5s  %s\n' "$name" "${runs:-?}" "${rate:-?}" "${reached:-?}" "${edges:-?}" "$result"
done
exit $status
