#!/usr/bin/env bash
# Makes a wheel that needs nothing but numpy, and tests it: beside other versions of MuJoCo, in fresh environments
# (tests/python/test_installs.py); with the package mujoco of its own version all of tests/python; and
# tests/python/extras in an environment with the optional packages.
#
#     tools/wheel.sh [--from BUILD]      the wheel lies in build/wheel/dist
#
# --from takes the libraries that are in a build folder, and compiles only what is missing there (./check: nothing).
# Without it everything is built from nothing, as `pip install .` does.
set -euo pipefail
cd "$(dirname "$0")/.."
from=()
python=$(command -v python3)
if [ "${1:-}" = --from ]; then
  cmake --build "$2" --target fork1s_wheel >/dev/null
  from=(--config-settings cmake.source-dir=bindings/python/from_build
    --config-settings cmake.define.FORK1S_BUILD="$(realpath "$2")")
  # The module is for the Python that CMake found there.
  python=$(sed -n 's/^_\?Python_EXECUTABLE:[A-Z]*=//p' "$2/CMakeCache.txt" | head -1)
else
  bash tools/setup.sh
fi
work=build/wheel
mkdir -p "$work"

# Tools stay, as they are pinned; a change of their versions makes them again.
if ! cmp -s tools/wheel.txt "$work/tools.txt" || [ ! -x "$work/tools/bin/python" ]; then
  echo "wheel: installing its tools into $work/tools"
  rm -rf "$work/tools"
  "$python" -m venv "$work/tools"
  "$work/tools/bin/pip" install --quiet --disable-pip-version-check --require-hashes -r tools/wheel.txt
  cp tools/wheel.txt "$work/tools.txt"
fi
tools=$PWD/$work/tools/bin

echo "wheel: building ($work/dist)"
rm -rf "$work/raw" "$work/dist"
if ! PATH="$tools:$PATH" "$tools/pip" wheel . --verbose --disable-pip-version-check --no-deps --no-build-isolation \
  --wheel-dir "$work/raw" "${from[@]}" >"$work/build.log" 2>&1; then
  cat "$work/build.log" >&2
  exit 1
fi
# Takes in the libraries of the system, under names of their own, as libmujoco has one already (cmake/CarryMujoco.cmake).
PATH="$tools:$PATH" "$tools/auditwheel" repair --wheel-dir "$work/dist" \
  "$work"/raw/*.whl >"$work/repair.log" 2>&1 || { cat "$work/repair.log" >&2; exit 1; }
"$python" tools/wheel_licenses.py "$work"/dist/*.whl ${from:+"$2"}

# What needs optional packages is tested beside the rest; its environment stays, as it is pinned.
mujoco="mujoco-core==$(sed -n 's/^mujoco-core==\([0-9.]*\).*/\1/p' cmake/mujoco.txt)"
test_extras() {
  if ! cmp -s tools/wheel_extras.txt "$work/extras.txt" || [ ! -x "$work/extras/bin/python" ]; then
    echo "wheel: installing optional packages into $work/extras"
    rm -rf "$work/extras" "$work/extras.txt"
    "$python" -m venv --without-pip "$work/extras"
    "$tools/pip" --python "$work/extras/bin/python" install --quiet --disable-pip-version-check --no-compile \
      --require-hashes -r tools/wheel_extras.txt
    cp tools/wheel_extras.txt "$work/extras.txt"
  fi
  "$tools/pip" --python "$work/extras/bin/python" install --quiet --disable-pip-version-check --force-reinstall --no-deps \
    "$work"/dist/*.whl "$mujoco"
  echo "wheel: testing with optional packages: sweeps, environments for learning, log viewers, pieces of meshes"
  env -u PYTHONPATH "$work/extras/bin/python" -m pytest -p no:cacheprovider tests/python/extras
}
set -m  # a process group of its own, to be ended as one
(test_extras) >"$work/extras.log" 2>&1 </dev/null &
extras=$!
set +m
trap 'kill -- "-$extras" 2>/dev/null || true' EXIT

echo "wheel: testing $(basename "$work"/dist/*.whl) in a fresh environment"
rm -rf "$work/fresh"
test_fresh() {  # with the tools' pip, which saves installing one
  "$python" -m venv --without-pip "$work/fresh" &&
    "$tools/pip" --python "$work/fresh/bin/python" install --quiet --disable-pip-version-check "$work"/dist/*.whl \
      "$(sed -n 's/^\(pytest==[0-9.]*\).*/\1/p' tools/wheel.txt)" "$mujoco" &&
    env -u PYTHONPATH FORK1S_WHEEL="$(ls "$PWD/$work"/dist/*.whl)" FORK1S_PIP="$tools/pip" "$work/fresh/bin/python" \
      -m pytest tests/python --ignore tests/python/extras
}
failed=""
test_fresh || failed=yes
wait "$extras" || failed=yes
trap - EXIT
cat "$work/extras.log"
[ -z "$failed" ]
