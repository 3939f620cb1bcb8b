#!/usr/bin/env bash
# Searches for inputs that break a promise, for hours: the targets of tests/fuzz with clang's libFuzzer and the sanitizers of
# addresses and undefined behaviour, one after the other.
#
#     tools/fuzz.sh HOURS [TARGET...]     HOURS in all, 0.1 say; mjcf urdf mesh controls recording message mechanism
#
# Needs Debian's clang-16 with libclang-rt-16-dev and installs nothing. Builds in build/fuzz, ten minutes on one core the first time. What is
# found stays in build/fuzz/run/TARGET (crash-*, timeout-*, oom-*), which is also where the next run goes on. An input there
# is tried again by
#
#     build/fuzz/tests/fuzz_TARGET FILE
set -euo pipefail
cd "$(dirname "$0")/.."
all=(controls message urdf mjcf mechanism recording mesh)
if [ $# -lt 1 ] || ! [[ $1 =~ ^[0-9]+(\.[0-9]+)?$ ]]; then
  sed -n '2,12s/^# \{0,1\}//p' "$0" >&2
  exit 2
fi
hours=$1
shift
targets=("${@:-${all[@]}}")
for target in "${targets[@]}"; do
  [[ " ${all[*]} " == *" $target "* ]] || { echo "fuzz: there is no target '$target'; there are ${all[*]}" >&2; exit 2; }
done
if ! command -v clang++-16 >/dev/null || [ ! -e "$(clang++-16 -print-file-name=libclang_rt.fuzzer-x86_64.a)" ]; then
  echo "fuzz: nothing is searched: needs clang 16 with its runtime library: apt-get install clang-16 libclang-rt-16-dev" >&2
  exit 77  # as for tests that are skipped
fi

mujoco=()
for folder in build/release/mujoco-*; do  # the one that is there already, else it is fetched again
  [ ! -e "$folder/include/mujoco/mujoco.h" ] || mujoco=("-DMUJOCO_ROOT=$PWD/$folder")
done
echo "fuzz: building ${targets[*]} (build/fuzz)"
cmake -S . -B build/fuzz -G Ninja -DCMAKE_C_COMPILER=clang-16 -DCMAKE_CXX_COMPILER=clang++-16 -DCMAKE_BUILD_TYPE=Debug \
  "-DCMAKE_CXX_FLAGS_DEBUG=-O1 -gline-tables-only" -DFORK1S_SANITIZE=ON -DFORK1S_FUZZ=ON -DFORK1S_BUILD_TESTS=ON \
  -DFORK1S_BUILD_BENCHMARKS=OFF -DFORK1S_BUILD_EXAMPLES=OFF -DFORK1S_BUILD_PYTHON=OFF "${mujoco[@]}" >/dev/null
cmake --build build/fuzz --target "${targets[@]/#/fuzz_}"

seconds=$(awk -v h="$hours" -v n=${#targets[@]} 'BEGIN { s = int(3600 * h / n); print (s > 0 ? s : 1) }')
source=$PWD
failed=""
for target in "${targets[@]}"; do
  run=$source/build/fuzz/run/$target
  mkdir -p "$run/corpus"
  leaks=1
  # Assimp leaves some of a glTF that it refuses, HDF5 some of a damaged file.
  [ "$target" != mesh ] && [ "$target" != recording ] || leaks=0
  # Third-party code prints; what libFuzzer and the sanitizers say is kept.
  if ! (cd "$run" && ASAN_OPTIONS=detect_leaks=$leaks UBSAN_OPTIONS=print_stacktrace=1 "$source/build/fuzz/tests/fuzz_$target" -max_total_time="$seconds" -timeout=30 -rss_limit_mb=4096 \
      -max_len=8192 -detect_leaks=$leaks -artifact_prefix="$run/" -print_final_stats=1 corpus "$source/tests/fuzz/corpus/$target" >log 2>&1); then
    failed=yes
    echo "fuzz: $target: found something, see $run/log:" >&2
    grep -m1 -E '^SUMMARY|terminate called|what\(\)' "$run/log" >&2 || tail -1 "$run/log" >&2
  fi
  echo "fuzz: $target: $(sed -n 's/^stat::number_of_executed_units: *//p' "$run/log") inputs in $seconds s at most"
done
[ -z "$failed" ]
