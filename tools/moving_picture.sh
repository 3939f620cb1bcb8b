#!/usr/bin/env bash
# Draws docs/hand.webp, the moving picture of the README: the hand of ./demo takes a box, lifts it and is shaken. Needs
# chromium and ffmpeg, a built fork1s and its example hand_demo. Two minutes, since nothing draws but the processor.
#
#     bash tools/moving_picture.sh [BUILD]      default: build/release
set -euo pipefail
cd "$(dirname "$0")/.."
build=${1:-build/release}
out=docs/hand.webp
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"$build/examples/hand_demo" scenes/hand.xml "$work/hand.csv" >/dev/null
"$build/bin/fork1s" run scenes/hand.xml --keyframe open --controls "$work/hand.csv" --time 5.6 --record "$work/hand.h5" \
  >/dev/null 2>&1
"$build/bin/fork1s" export "$work/hand.h5" "$work/hand.mp4" --width 560 --height 350 --from=-50,14 --zoom=1.1 \
  >/dev/null </dev/null
ffmpeg -loglevel error -y -i "$work/hand.mp4" -vf fps=15 -c:v libwebp_anim -loop 0 -q:v 55 -compression_level 6 "$out"
size=$(stat -c %s "$out")
echo "$out: $((size / 1024)) kB"
[ "$size" -le 2000000 ] || { echo "$out is larger than 2 MB: fewer frames or a lower quality" >&2; exit 1; }
