#!/bin/bash
# The speed benchmark with each of the vector instruction sets that this machine has, side by side: most users have no
# AVX-512.   bash tests/benchmark/speed_vectors.sh [ROUNDS, 3]   Builds one benchmark for each, in build/vectors_*.
set -euo pipefail
cd "$(dirname "$0")/../.."
. configs/packages.sh

sets=none
grep -qw avx2 /proc/cpuinfo && sets="avx2 $sets"
grep -qw avx512f /proc/cpuinfo && sets="avx512 $sets"
for set in $sets; do
  build_huetrack "build/vectors_$set" "-DCMAKE_BUILD_TYPE=Release -DHUETRACK_BENCHMARKS=ON -DHUETRACK_VECTORS=$set" speed
done
for round in $(seq "${1:-3}"); do
  for set in $sets; do
    echo
    echo "== round $round, $set"
    "build/vectors_$set/tests/benchmark/speed" --quick || true # a ratio that is missed is printed as that
  done
done
