# shellcheck shell=bash
# Sourced by the scripts that draw pictures.

# Reduces the colours of FROM so that TO stays small.
shrink_picture() { # FROM TO
  ffmpeg -nostdin -y -loglevel error -i "$1" \
    -vf "split[a][b];[a]palettegen=max_colors=128:stats_mode=full[p];[b][p]paletteuse=dither=none" \
    -frames:v 1 -update 1 "$2"
  echo "$2: $(stat -c %s "$2") bytes"
}
