#!/usr/bin/env bash
# Installs what the build and the tests need from Debian's packages, and says so. Does nothing where all is there.
#
#     tools/setup.sh [build|rest|format]     what compiling needs; what only tests, films and pictures need; both unless
#                                            told. format: what tools/format.sh needs
#
# ./check and ./demo fetch the rest, which is the larger part, while they compile.
set -euo pipefail

# python3-pip fetches MuJoCo, which comes from Python's registry (cmake/Findmujoco.cmake); the headers are for our module.
build_packages=(
  g++ cmake ninja-build ccache
  libeigen3-dev python3-pip python3-dev python3-venv libtinyxml2-dev libcli11-dev libfmt-dev nlohmann-json3-dev
  libexpected-dev libhdf5-dev zlib1g-dev libtbb-dev libspectra-dev libassimp-dev libminizip-dev libhwy-dev
  libgtest-dev
  libboost-dev
  libgles-dev
)
# Programs that may be there without Debian's packages: command and package.
build_programs=(node:nodejs npm:npm)
rest_programs=(chromium:chromium ffmpeg:ffmpeg)
# What runs shaders/ without a graphics card, and what translates them.
rest_packages=(libegl-mesa0 libgl1-mesa-dri glslang-tools spirv-tools spirv-cross)
format_packages=(clang-format-16 shellcheck python3-venv wamerican wbritish)

packages=() programs=()
case "${1:-all}" in
  build) packages=("${build_packages[@]}") programs=("${build_programs[@]}") ;;
  rest) packages=("${rest_packages[@]}") programs=("${rest_programs[@]}") ;;
  format) packages=("${format_packages[@]}") ;;
  all) packages=("${build_packages[@]}" "${rest_packages[@]}") programs=("${build_programs[@]}" "${rest_programs[@]}") ;;
  *)
    sed -n '2,7s/^# \{0,1\}//p' "$0" >&2
    exit 2
    ;;
esac

is_installed() { dpkg-query -W -f '${Status}' "$1" 2>/dev/null | grep -q 'install ok installed'; }
missing=()
for package in "${packages[@]}"; do
  is_installed "$package" || missing+=("$package")
done
for program in "${programs[@]}"; do
  if ! command -v "${program%%:*}" >/dev/null; then
    missing+=("${program##*:}")
  fi
done
# The rest is installed in the background, where nobody can be asked for a password.
if [ "${1:-all}" = build ] && [ "$(id -u)" -ne 0 ] && command -v sudo >/dev/null; then
  later=""
  for program in "${rest_programs[@]}"; do command -v "${program%%:*}" >/dev/null || later=yes; done
  for package in "${rest_packages[@]}"; do is_installed "$package" || later=yes; done
  [ -z "$later" ] || sudo -v
fi
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
# A list of packages that is an hour old is that of the first part.
if [ -z "$(find /var/lib/apt/lists -maxdepth 1 -name '*Packages*' -mmin -60 2>/dev/null | head -1)" ] ||
  [[ ${1:-all} != @(rest|format) ]]; then
  "${as_root[@]}" apt-get update -qq
fi
"${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "${missing[@]}" >/dev/null
echo "setup: done"
