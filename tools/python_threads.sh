#!/usr/bin/env bash
# tests/python/test_threads.py with the Python module under the thread sanitizer: a data race between any two calls ends
# its process with an error.
#
#     tools/python_threads.sh [PYTHON]     a Python with numpy and pytest; by default that of tools/wheel.sh
#
# Builds in build/thread, half an hour on two cores the first time. Three minutes of tests.
set -euo pipefail
cd "$(dirname "$0")/.."
python=${1:-build/wheel/extras/bin/python}
if ! "$python" -c 'import numpy, pytest' 2>/dev/null; then
  echo "python_threads: '$python' has no numpy or pytest: run tools/wheel.sh first, or name another Python" >&2
  exit 2
fi
runtime=$("${CXX:-c++}" -print-file-name=libtsan.so)
if [ ! -e "$runtime" ]; then
  echo "python_threads: nothing is tested: the compiler has no libtsan (GCC of Debian has)" >&2
  exit 77  # as for tests that are skipped
fi
cmake --preset thread -DFORK1S_BUILD_TESTS=ON -DFORK1S_BUILD_PYTHON=ON -DFORK1S_BUILD_FMU=OFF >/dev/null
bash tools/build.sh python_threads thread fork1s_python fork1s_python_files
echo "python_threads: testing"
PYTHONPATH=build/thread/bindings/python LD_PRELOAD=$(realpath "$runtime") "$python" -m pytest tests/python/test_threads.py
