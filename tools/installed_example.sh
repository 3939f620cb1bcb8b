#!/usr/bin/env bash
# What the README says to somebody who writes C++: installs a build, makes programs of the examples that lie there with
# find_package(fork1s) and nothing else, and runs them. Nothing of lab/ may be installed.
#
#     tools/installed_example.sh [BUILD]      default: build/release
set -euo pipefail
cd "$(dirname "$0")/.."
build=$(realpath "${1:-build/release}")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cmake --install "$build" --prefix "$work/installed" >"$work/install.log" || { cat "$work/install.log" >&2; exit 1; }
mapfile -t headers < <(find lab -name '*.hpp' -printf '-o\n-name\n%f\n')
if find "$work/installed" -name '*fork1s_lab*' "${headers[@]}" | grep . ||
  grep -rn 'fork1s::lab\|fork1s_lab' "$work/installed" --include='*.cmake'; then
  echo "installed_example: these belong to lab/, which is for measurements of the project alone; install none of it" >&2
  exit 1
fi
cp -r "$work/installed/share/fork1s/examples" "$work/app"
# Without optimisation: what is long about them is compiling.
if ! { cmake -S "$work/app" -B "$work/app/build" -DCMAKE_PREFIX_PATH="$work/installed" &&
  cmake --build "$work/app/build"; } >"$work/app.log"; then
  cat "$work/app.log" >&2
  exit 1
fi
"$work/app/build/first_steps" scenes/hand.xml
"$work/app/build/in_your_loop" scenes/fourbar_gripper.xml | tee "$work/said"
grep -q "there is no control 'thumb'; there are: left_grip" "$work/said"
grep -q "and back it is as it was" "$work/said"
grep -q "^at 3.00 s there are" "$work/said"
if [ -x "$work/app/build/engine_poses" ]; then
  # 3: it says that there is no OpenGL ES 3.1.
  "$work/app/build/engine_poses" scenes/hand.xml "$work/installed/share/fork1s/shaders" | tee "$work/said" || [ $? -eq 3 ]
  grep -q "^22 bodies from .* off by at most [0-9.]*e-0[789] m" "$work/said" || grep -q "^EGL " "$work/said"
fi
