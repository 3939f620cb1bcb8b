#!/usr/bin/env bash
# Whether builds of other levels and compilers give the same bits: the hash of five scenes' states after 7 to 14
# simulated seconds each, in one column a build.
#
#     tools/same_bits.sh release -O0 '-O1 -ffp-contract=off' 'clang++-16 -O1 -ffp-contract=off'
#
# `release` is build/release; else the words are flags, after a compiler if it is not the usual one, of a build in
# build/bits (FORK1S_BITS names another folder), made if need be: some minutes each. Exit code 1 where bits differ;
# docs/reliability.md says between which builds they do, and by what operation.
set -euo pipefail
cd "$(dirname "$0")/.."
[ $# -gt 0 ] || { sed -n '2,9s/^# \{0,1\}//p' "$0"; exit 2; }
root=${FORK1S_BITS:-build/bits}
mkdir -p "$root"
runs=("grasp_sphere 0.004 grasp_sphere" "hexapod_terrain 0.004 hexapod_terrain" "firemen 0.002" "vehicle 0.004" "hammer 0.002 hammer")
benchmarks=()
for build in "$@"; do
  if [ "$build" = release ]; then
    folder=build/release
    cmake --preset release >/dev/null
  else
    folder=$root/$(tr -cs '[:alnum:]=\n' _ <<<"$build")
    compiler=() flags=$build
    case "$build" in -*) ;; *) compiler=("-DCMAKE_CXX_COMPILER=${build%% *}"); flags=${build#* } ;; esac
    cmake -B "$folder" -G Ninja -DCMAKE_BUILD_TYPE=Debug "-DCMAKE_CXX_FLAGS_DEBUG=$flags" "${compiler[@]}" \
      -DFORK1S_BUILD_TESTS=OFF -DFORK1S_BUILD_PYTHON=OFF >/dev/null
  fi
  echo "same_bits: building '$build' ($folder)" >&2
  cmake --build "$folder" --target soak >/dev/null
  benchmarks+=("$folder/benchmarks/soak")
done
differ=""
for run in "${runs[@]}"; do
  read -r scene hours table <<<"$run"
  first="" row=$(printf '%-16s' "$scene")
  for soak in "${benchmarks[@]}"; do
    hash=$("$soak" "scenes/$scene.xml" "$hours" ${table:+"scenes/$table.csv"} | tail -1 | sed 's/.*,//')
    row+=" $hash"
    first=${first:-$hash}
    [ "$hash" = "$first" ] || differ=yes
  done
  echo "$row"
done
[ -z "$differ" ] || { echo "same_bits: they differ" >&2; exit 1; }
