#!/usr/bin/env bash
# What the README says to somebody who writes C++: installs a build, makes a program of the example that lies there with
# find_package(fork1s) and nothing else, and runs it.
#
#     tools/installed_example.sh [BUILD]      default: build/release
set -euo pipefail
cd "$(dirname "$0")/.."
build=$(realpath "${1:-build/release}")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cmake --install "$build" --prefix "$work/installed" >"$work/install.log" || { cat "$work/install.log" >&2; exit 1; }
mkdir "$work/app"
cp "$work/installed/share/fork1s/examples/first_steps.cpp" "$work/app/"
cat >"$work/app/CMakeLists.txt" <<'EOF'
cmake_minimum_required(VERSION 3.25)
project(app LANGUAGES CXX)
find_package(fork1s REQUIRED)
add_executable(app first_steps.cpp)
target_link_libraries(app PRIVATE fork1s::fork1s)
EOF
cmake -S "$work/app" -B "$work/app/build" -DCMAKE_PREFIX_PATH="$work/installed" >"$work/app.log" &&
  cmake --build "$work/app/build" >>"$work/app.log" || { cat "$work/app.log" >&2; exit 1; }
"$work/app/build/app" scenes/hand.xml
