#!/bin/bash
# What changed since the last tag, for the checks that are too long to run over everything each time.
#   tests/changed.sh modules                  the folders of tests/ whose modules changed; without a tag a third of all, another one
#                                             with each commit
#   tests/changed.sh tidy SECONDS             clang-tidy over changed .cpp files, the last changed first, until SECONDS have passed.
#                                             Exit status 1: it found something.
set -euo pipefail
cd "$(dirname "$0")/.."

# Pairs of a source folder and its folder of tests. Browsers, whole programs, VMs and long runs are left out.
pairs() {
  local folder name
  for folder in calib/* service/* service/object_tracking/* service/camera_tracking/* clients/*; do
    [ -f "$folder/CMakeLists.txt" ] || continue
    name=$(basename "$folder")
    case $folder in
      clients/huetrack) name=client ;;
    esac
    [ -f "tests/$name/CMakeLists.txt" ] && echo "$folder $name"
  done
}
last_tag=$(git describe --tags --abbrev=0 2>/dev/null || true)

case ${1:-} in
  modules)
    if [ -n "$last_tag" ]; then
      changed=$(git diff --name-only "$last_tag" HEAD)
      pairs | while read -r folder name; do
        # a folder's own files, or those of a folder below it that has no tests of its own
        grep -E "^($folder|tests/$name)/" <<<"$changed" | while read -r file; do
          inner=${file#"$folder"/}
          [ "$inner" = "${inner%%/*}" ] || [ ! -d "tests/${inner%%/*}" ] && { echo "$name"; break; }
        done
      done || true
    else
      pairs | awk -v turn=$(($(git rev-list --count HEAD) % 3)) 'NR % 3 == turn { print $2 }'
    fi
    ;;
  tidy)
    end=$((SECONDS + $2)) found=0 looked=0
    tidy=$(command -v clang-tidy-16 || command -v clang-tidy)
    mapfile -t files < <(git log --format= --name-only --diff-filter=AM ${last_tag:+"$last_tag.."} -n 20 -- 'service/*.cpp' 'calib/*.cpp' \
      'clients/*.cpp' 'idl/*.cpp' | awk '!seen[$0]++')
    # A build folder of its own: precompiled headers and unity builds are nothing for clang-tidy. Of the build it needs the types
    # that are generated from the IDL.
    cmake -S . -B build/tidy -G Ninja -DCMAKE_BUILD_TYPE=Release -DCMAKE_DISABLE_PRECOMPILE_HEADERS=ON -DHUETRACK_VM_TESTS=off >/dev/null
    cmake --build build/tidy --target idl/generated/idl/huetrack.h >/dev/null
    for file in "${files[@]}"; do
      [ -f "$file" ] || continue
      [ $SECONDS -lt $end ] || break
      "$tidy" -p build/tidy --quiet --warnings-as-errors='*' "$file" || found=1
      looked=$((looked + 1))
    done
    echo "== clang-tidy: $looked of ${#files[@]} changed files"
    exit $found
    ;;
  *)
    echo "usage: tests/changed.sh modules | tidy SECONDS" >&2
    exit 2
    ;;
esac
