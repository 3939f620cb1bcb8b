#!/usr/bin/env bash
# How many instructions it takes to reduce a mechanism again about its present pose, counted by valgrind: the same number
# on any machine, however busy, of the same instruction set. Of all refreshes in the first second, twenty of which are
# asked for on the way.
#
#     tools/refresh_instructions.sh [--build FOLDER] SCENE...
#
# A SCENE is a name in scenes/ or a path to a model; a table of controls beside it, SCENE.csv, drives it.
set -euo pipefail
root=$(cd "$(dirname "$0")/.." && pwd)

build=$root/build/release
if [ "${1:-}" = --build ]; then
  build=$2
  shift 2
fi
if [ $# -eq 0 ] || [ "${1#-}" != "$1" ]; then
  sed -n '2,8s/^# \{0,1\}//p' "$0" >&2
  exit 2
fi
if ! command -v valgrind >/dev/null; then
  echo "refresh_instructions: valgrind is missing; install it by: apt-get install valgrind" >&2
  exit 1
fi
program=$build/benchmarks/refresh_cost
if [ ! -x "$program" ]; then
  echo "refresh_instructions: $program is missing; build it by: cmake --build $build --target refresh_cost" >&2
  exit 1
fi

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
echo "scene,refreshes,instructions"
for scene in "$@"; do
  model=$scene
  [ -f "$model" ] || model=$root/scenes/$scene.xml
  if [ ! -f "$model" ]; then
    echo "refresh_instructions: there is no scene '$scene'" >&2
    exit 1
  fi
  controls=${model%.*}.csv
  [ -f "$controls" ] || controls=-
  valgrind --tool=callgrind --callgrind-out-file="$work/profile" \
    --toggle-collect='fork1s::Refresh(*' "$program" "$model" "$controls" 1 1 \
    >"$work/out" 2>"$work/log" || {
    cat "$work/out" "$work/log" >&2
    exit 1
  }
  # The steps' own refreshes are in the sum as well.
  tail -1 "$work/out" | awk -F, -v all="$(awk '/^(totals|summary):/ { print $2; exit }' "$work/profile")" '{
    printf "%s,%d,%.0f\n", $1, $4 + $5, all / ($4 + $5) }'
done
