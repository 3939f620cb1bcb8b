#!/usr/bin/env bash
# Installs what the build and the tests need from Debian's packages, and says so. Does nothing where all is there.
set -euo pipefail

# python3-pip fetches MuJoCo, which comes from Python's registry (cmake/Findmujoco.cmake); the headers are for our module.
packages=(
  g++ cmake ninja-build ccache
  libeigen3-dev python3-pip python3-dev python3-venv libtinyxml2-dev libcli11-dev libfmt-dev nlohmann-json3-dev
  libexpected-dev libhdf5-dev libtbb-dev libspectra-dev libassimp-dev
  libgtest-dev
  libboost-dev
)
# Programs that may be there without Debian's packages: command and package.
programs=(node:nodejs npm:npm chromium:chromium ffmpeg:ffmpeg)

missing=()
for package in "${packages[@]}"; do
  if ! dpkg-query -W -f '${Status}' "$package" 2>/dev/null | grep -q 'install ok installed'; then
    missing+=("$package")
  fi
done
for program in "${programs[@]}"; do
  if ! command -v "${program%%:*}" >/dev/null; then
    missing+=("${program##*:}")
  fi
done
if [ ${#missing[@]} -eq 0 ]; then
  echo "setup: all ${#packages[@]} packages and ${#programs[@]} programs are there"
  exit 0
fi

as_root=()
if [ "$(id -u)" -ne 0 ]; then
  if ! command -v sudo >/dev/null; then
    echo "setup: these packages are missing and need root to install: ${missing[*]}" >&2
    exit 1
  fi
  as_root=(sudo)
fi
echo "setup: installing ${missing[*]}"
"${as_root[@]}" apt-get update -qq
"${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "${missing[@]}" >/dev/null
echo "setup: done"
