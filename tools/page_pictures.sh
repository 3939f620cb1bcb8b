#!/usr/bin/env bash
# Takes docs/page_NAME.png: the live page as a browser shows it, touched by a program. Needs a release build, chromium and
# ffmpeg. With names it takes those alone.
#
#     bash tools/page_pictures.sh [NAME...]
set -euo pipefail
cd "$(dirname "$0")/.."
source tools/shrink_picture.sh
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
export FORK1S_SOURCE_DIR=$PWD FORK1S_BINARY=$PWD/build/release/bin/fork1s
(cd build/release/viewer/work && node tools/page_pictures.mjs "$folder" "$@")
for picture in "$folder"/*.png; do shrink_picture "$picture" "docs/$(basename "$picture")"; done
