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
# In C, as docs/c.md says it, and by a CMake project that knows no C++.
lib=$(dirname "$(find "$work/installed" -name libfork1s_c.so)")
cc -std=c99 "$work/app/first_steps.c" "-I$work/installed/include" "-L$lib" -lfork1s_c "-Wl,-rpath,$lib" -o "$work/c_steps"
mkdir "$work/c"
cat >"$work/c/CMakeLists.txt" <<'END'
cmake_minimum_required(VERSION 3.25)
project(app LANGUAGES C)
find_package(fork1s_c REQUIRED)
add_executable(c_steps ../app/first_steps.c)
target_link_libraries(c_steps PRIVATE fork1s::c)
END
if ! { cmake -S "$work/c" -B "$work/c/build" -DCMAKE_PREFIX_PATH="$work/installed" &&
  cmake --build "$work/c/build"; } >"$work/c.log"; then
  cat "$work/c.log" >&2
  exit 1
fi
for program in "$work/c_steps" "$work/c/build/c_steps"; do
  "$program" scenes/fourbar_gripper.xml | tee "$work/said"
  grep -q "^50 steps" "$work/said" && grep -q "^cube stands at" "$work/said"
done
"$work/app/build/in_your_loop" scenes/fourbar_gripper.xml | tee "$work/said"
grep -q "there is no control 'thumb'; there are: left_grip" "$work/said"
grep -q "and back it is as it was" "$work/said"
grep -q "^at 3.00 s there are" "$work/said"
if [ -x "$work/app/build/engine_poses" ]; then
  # 3: it says that there is no OpenGL ES 3.1.
  "$work/app/build/engine_poses" scenes/hand.xml "$work/installed/share/fork1s/shaders" | tee "$work/said" || [ $? -eq 3 ]
  grep -q "^22 bodies from .* off by at most [0-9.]*e-0[789] m" "$work/said" || grep -q "^EGL " "$work/said"
fi
