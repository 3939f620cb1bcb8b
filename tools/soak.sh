#!/usr/bin/env bash
# Simulated days at full speed: whether memory, energy, loops or poses go anywhere, and whether every step converges.
#
#     tools/soak.sh [HOURS [SCENE...]]     24 simulated hours each; hand hexapod firemen vehicle page
#
# `page` is the live server with three viewers, one of which drags and one of which hardly reads
# (tests/server/soak_test.cpp, which fails where memory grows, a step fails or a viewer is forgotten).
# Builds build/release/benchmarks/soak if need be, prints a row a simulated hour (benchmarks/soak.cpp says what) into
# build/soak/SCENE.csv, and at the end what the first hour and the last differ by. Minutes a scene. Fails where a step was
# undone, did not converge or dropped contacts, where memory grew by more than 1 MB after the first hour, or where
# anything that is held or stands is not where it was after the first hour, by a tenth of a millimetre; the vehicle, whose wheels
# spin freely, by a centimetre.
set -euo pipefail
cd "$(dirname "$0")/.."
hours=${1:-24}
shift || true
scenes=("${@:-}")
[ -n "${scenes[0]}" ] || scenes=(hand hexapod firemen vehicle page)
declare -A arguments=(
  [hand]="grasp_sphere.xml grasp_sphere.csv ball:0.3,0,0"
  [hexapod]="hexapod_terrain.xml hexapod_terrain.csv trunk:2,1,0"
  [firemen]="firemen.xml - bunny:1,0,0"
  [vehicle]="vehicle.xml - chassis:0,50,0"
)
cmake --build --preset release --target soak >/dev/null
mkdir -p build/soak
failed=""
for scene in "${scenes[@]}"; do
  if [ "$scene" = page ]; then
    cmake --build --preset release --target test_server >/dev/null
    FORK1S_SOAK_HOURS=$hours build/release/tests/test_server --gtest_filter='ServerSoak.*' >build/soak/page.log || failed=yes
    grep -E '^(hour|[0-9]+),' build/soak/page.log >build/soak/page.csv || failed=yes
    awk -F, 'NR == 2 { memory = $3 } NR > 1 { us += $2; last = $0 }
      END { split(last, f, ","); printf "soak: page: %d hours at %.1f us a frame; memory %.2f -> %.2f MB; viewers read %d frames, the slow one %d\n", \
              NR - 1, us / (NR - 1), memory, f[3], f[5], f[6] }' build/soak/page.csv
    continue
  fi
  [ -n "${arguments[$scene]:-}" ] || { echo "soak: there is no scene '$scene'; there are ${!arguments[*]} page" >&2; exit 2; }
  read -r model controls push <<<"${arguments[$scene]}"
  [ "$controls" = - ] || controls=scenes/$controls
  file=build/soak/$scene.csv
  build/release/benchmarks/soak "scenes/$model" "$hours" "$controls" "$push" >"$file" || { failed=yes; echo "soak: $scene: a step failed" >&2; }
  away=0.1
  [ "$scene" != vehicle ] || away=10
  awk -F, -v scene="$scene" -v away=$away '
    NR == 2 { memory = $4 }
    NR > 1 { steps += $12 + $13 + $14; if ($10 > creep) { creep = $10; body = $11 } last = $0; us += $3; if ($8 > gap) gap = $8
             if (NR > 2 && (low == "" || $5 < low)) low = $5; if (NR > 2 && (high == "" || $6 > high)) high = $6; failed += $16 }
    END { split(last, f, ",")
          printf "soak: %s: %d hours at %.1f us a step; memory %.2f -> %.2f MB; energy from the second hour on %s to %s J; loops open by at most %g mm; at most %g mm away (%s); %d bad steps, %d failed refreshes\n", \
            scene, NR - 1, us / (NR - 1), memory, f[4], low, high, gap, creep, body, steps, failed
          exit steps > 0 || f[4] > memory + 1 || creep > away }' "$file" || failed=yes
done
[ -z "$failed" ]
