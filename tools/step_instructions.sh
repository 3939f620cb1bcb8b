#!/usr/bin/env bash
# How many instructions a step takes: of World::Step, and beside it of mj_step on the same file at the same time step
# of 1/60 s, over the first second or another. Counted by valgrind, so the same program gives the same number on any machine,
# however busy, of the same instruction set.
#
#     tools/step_instructions.sh [--build FOLDER] [--csv FILE] [--discrete] [--second N] [--recovery WORD] [--integrator WORD] SCENE...
#
# A SCENE is a name in scenes/ or a path to a model; a table of controls beside it, SCENE.csv, drives it.
# --discrete: MuJoCo integrates so, and not as the file says.
# --second 5 counts the steps from 4 s to 5 s: what N seconds took less what N - 1 took.
# --recovery: exact (default), expanded, curved or twist. --integrator: ours, euler or two-stage; what the scene chooses unless told.
# --build names another build folder (build/release unless told), to compare two of them.
set -euo pipefail
root=$(cd "$(dirname "$0")/.." && pwd)

build=$root/build/release csv="" integrator=- recovery=exact own=() second=1 scenes=()
while [ $# -gt 0 ]; do
  case "$1" in
    --build) build=$2 && shift ;;
    --csv) csv=$2 && shift ;;
    --discrete) integrator=discrete ;;
    --recovery) recovery=$2 && shift ;;
    --integrator) own=("$2") && shift ;;
    --second) second=$2 && shift ;;
    -*) scenes=() && break ;;
    *) scenes+=("$1") ;;
  esac
  shift
done
if [ ${#scenes[@]} -eq 0 ]; then
  sed -n '2,13s/^# \{0,1\}//p' "$0" >&2
  exit 2
fi
if ! command -v valgrind >/dev/null; then
  echo "step_instructions: valgrind is missing; install it by: apt-get install valgrind" >&2
  exit 1
fi
program=$build/benchmarks/step_instructions
if [ ! -x "$program" ]; then
  echo "step_instructions: $program is missing; build it by: cmake --build $build --target step_instructions" >&2
  exit 1
fi

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
header="scene,steps,contacts_ours,contacts_mujoco,instructions_ours,instructions_mujoco,ratio"
echo "$header"
[ -z "$csv" ] || echo "$header" >"$csv"

# Instructions of all calls of the function that $2 matches, with all that it calls, in profile $1.
inclusive() {
  callgrind_annotate --inclusive=yes --threshold=100 "$1" | awk -v name="$2" '
    index($0, name) && !found { gsub(",", "", $1); print $1; found = 1 }'
}

for scene in "${scenes[@]}"; do
  model=$scene
  [ -f "$model" ] || model=$root/scenes/$scene.xml
  if [ ! -f "$model" ]; then
    echo "step_instructions: there is no scene '$scene'" >&2
    exit 1
  fi
  controls=${model%.*}.csv
  [ -f "$controls" ] || controls=-
  # Only what runs within the two functions is collected. Valgrind's data segment may end at a library: what malloc meets there
  # stays in errno, and MuJoCo takes it for a number that cannot be read. With room asked for at once it goes elsewhere.
  sums=(0 0 0)
  for seconds in $((second - 1)) "$second"; do
    [ "$seconds" -gt 0 ] || continue
    MALLOC_TOP_PAD_=50000000 valgrind --tool=callgrind --callgrind-out-file="$work/profile" --toggle-collect='fork1s::World::Step(*' \
      --toggle-collect=mj_step "$program" "$model" "$controls" "$seconds" "$integrator" "$recovery" "${own[@]}" >"$work/out" 2>"$work/log" || {
      cat "$work/out" "$work/log" >&2
      exit 1
    }
    read -r steps ours theirs <"$work/out"
    here=("$steps" "$(inclusive "$work/profile" 'fork1s::World::Step(')" "$(inclusive "$work/profile" ':mj_step ')")
    for i in 0 1 2; do sums[i]=$((here[i] - sums[i])); done
  done
  line=$(awk -v scene="$(basename "${model%.*}")" -v steps="${sums[0]}" -v ours="$ours" -v theirs="$theirs" \
    -v a="${sums[1]}" -v b="${sums[2]}" 'BEGIN {
    printf "%s,%d,%s,%s,%.0f,%.0f,%.3f\n", scene, steps, ours, theirs, a / steps, b / steps, a / b }')
  echo "$line"
  [ -z "$csv" ] || echo "$line" >>"$csv"
done
