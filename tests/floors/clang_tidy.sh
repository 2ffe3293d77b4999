#!/bin/bash
# clang-tidy with the checks of .clang-tidy over our files. clang_tidy.sh SOURCE-TREE BUILD-FOLDER
# What clang's compiler warns of besides is no error here: the build is GCC's, and some of its options are not clang's.
set -uo pipefail
tidy=$(command -v clang-tidy-16 || command -v clang-tidy) || { echo "SKIPPED: no clang-tidy"; exit 77; }
cd "$1" || exit 1
git ls-files 'calib/*.cpp' 'service/*.cpp' 'clients/*.cpp' 'idl/*.cpp' |
  xargs -P2 -n1 "$tidy" -p "$2" --quiet --extra-arg=-Wno-error --warnings-as-errors='*,-clang-diagnostic-*' 2>&1 |
  grep -v ' warnings\? generated\.$'
exit "${PIPESTATUS[2]}"
