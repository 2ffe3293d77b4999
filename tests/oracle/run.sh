#!/bin/bash
# Every figure that the product claims, in two minutes on two cores: replays some 20 short recordings with the built programs, prints
# one table, and holds each figure to its band in oracle.yaml. Exit status: 0 all in their bands, 1 a figure is out of its band,
# 77 nothing could be run (recordings or Python's packages are missing).
#   tests/oracle/run.sh [BUILD] [--only REGEX] [--tighten] [--jobs N]      BUILD: build/release if left out; README.md has the rest
set -euo pipefail
cd "$(dirname "$0")/../.."
exec /usr/bin/python3 tests/oracle/oracle.py "$@"
