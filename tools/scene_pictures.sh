#!/usr/bin/env bash
# Draws docs/scenes/NAME.png for every scene: runs it, takes one moment of the recording, and reduces its colours so
# that the file stays small. Needs chromium and ffmpeg. With names it draws those alone.
#
#     bash tools/scene_pictures.sh [SCENE...]          FORK1S=path/to/fork1s for another program
#
# "legged" is three machines beside each other, from models that are not part of the project: build
# benchmarks/legged first. MODELS=folder has them (../shared/models); without them it is left as it is.
set -euo pipefail
cd "$(dirname "$0")/.."
source tools/shrink_picture.sh
fork1s=${FORK1S:-build/release/bin/fork1s}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# scene, seconds simulated, moment, then where the camera stands
views="
firemen          1   0.36   --from=-62,14 --zoom=1.3
vehicle          5   3.6    --from=-50,18 --zoom=1.4
hexapod_terrain  7   6.2    --from=-50,22 --zoom=2.2 --look-at=trunk
excavator        9   8.3    --from=-62,20 --zoom=1.5
beam_walkers     7   6.5    --from=-60,18 --zoom=1.6
hammer           2   0.9    --from=-48,18 --zoom=1.0 --look-at=forearm
peg_in_hole      4   3.2    --from=-70,18 --zoom=2.2 --look-at=peg
peg_grasp        4   3      --from=-70,18 --zoom=2.2 --look-at=peg
grasp_sphere     4   3.1    --from=-50,12 --zoom=1.3
grasp_box        4   3.1    --from=-50,12 --zoom=1.3
grasp_mug        8   3.1    --from=35,25 --zoom=1.3
"

while read -r scene time at camera; do
  [ -n "$scene" ] || continue
  if [ $# -gt 0 ] && [[ " $* " != *" $scene "* ]]; then continue; fi
  controls=()
  [ -f "scenes/$scene.csv" ] && controls=(--controls "scenes/$scene.csv")
  # Held by friction until 0.5 s, then with frozen contacts.
  [ "$scene" != peg_grasp ] || controls=(--controls scenes/peg_in_hole.csv --detail "interface,0.5:object")
  "$fork1s" run "scenes/$scene.xml" "${controls[@]}" --time "$time" --record "$work/$scene.h5" >/dev/null 2>&1
  # shellcheck disable=SC2086  # the camera is several words
  "$fork1s" export "$work/$scene.h5" "$work/$scene.png" --at "$at" $camera --width 960 --height 540 </dev/null
  shrink_picture "$work/$scene.png" "docs/scenes/$scene.png"
done <<<"$views"

# Scenes that are made in code: picture, half of the benchmark, moment, camera
made="
long_arm    arms   1.2   --from=-70,18 --zoom=1.5
many_hands  hands  2.5   --from=-40,22 --zoom=2.6 --no-forces
"
while read -r scene half at camera; do
  [ -n "$scene" ] || continue
  if [ $# -gt 0 ] && [[ " $* " != *" $scene "* ]]; then continue; fi
  build/release/benchmarks/long_and_many --record "$work/$scene.h5" "$half"
  # shellcheck disable=SC2086
  "$fork1s" export "$work/$scene.h5" "$work/$scene.png" --at "$at" $camera --width 960 --height 540 </dev/null
  shrink_picture "$work/$scene.png" "docs/scenes/$scene.png"
done <<<"$made"

models=${MODELS:-../shared/models}
if { [ $# -eq 0 ] || [[ " $* " == *" legged "* ]]; } && [ -d "$models" ]; then
  while read -r machine camera; do
    [ -n "$machine" ] || continue
    build/release/benchmarks/legged --models "$models" --record "$work/$machine.h5" "$machine"
    # shellcheck disable=SC2086
    "$fork1s" export "$work/$machine.h5" "$work/$machine.png" --at 2.9 $camera --width 480 --height 540 </dev/null
  done <<<"
anymal --from=-50,15 --zoom=1.4
cassie --from=-55,10 --zoom=1.2
digit  --from=-55,10 --zoom=1.2
"
  ffmpeg -nostdin -y -loglevel error -i "$work/anymal.png" -i "$work/cassie.png" -i "$work/digit.png" \
    -filter_complex hstack=inputs=3 -frames:v 1 -update 1 "$work/legged.png"
  shrink_picture "$work/legged.png" docs/scenes/legged.png
fi
