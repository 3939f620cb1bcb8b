#!/usr/bin/env bash
# What the tests of a build cost: runs each test program, one after another, and writes program,seconds,user_s,system_s
# to standard output, a line a program as it ends. Seconds on the clock say how long it waits, or how busy the machine is.
#
#     tools/test_cost.sh [BUILD [PROGRAM...]] >FILE      BUILD: build/release unless told; PROGRAM: stepping, lab, ...
set -euo pipefail
cd "$(dirname "$0")/.."
build=${1:-build/release}
[ $# -eq 0 ] || shift
if ! compgen -G "$build/tests/test_*" >/dev/null; then
  echo "test_cost: $build/tests has no test programs; build them first (./check)" >&2
  exit 3
fi
programs=("$@")
if [ ${#programs[@]} -eq 0 ]; then
  for file in "$build"/tests/test_*; do
    [ ! -f "$file" ] || [ ! -x "$file" ] || programs+=("$(basename "$file" | sed 's/^test_//')")
  done
fi
echo "program,seconds,user_s,system_s"
failed=""
for program in "${programs[@]}"; do
  if [ ! -x "$build/tests/test_$program" ]; then
    echo "test_cost: there is no program $build/tests/test_$program; build the target test_$program" >&2
    exit 3
  fi
  TIMEFORMAT="$program,%R,%U,%S"
  { time "$build/tests/test_$program" >/dev/null 2>&1; } 2>&1 || {
    echo "test_cost: $program failed" >&2
    failed=yes
  }
done
[ -z "$failed" ]
