#!/usr/bin/env bash
# What a build costs: configures and builds every target of a release from nothing, without ccache, and prints the
# CPU seconds (user and system) of compilers by room, the dearest files, and how far each public header reaches.
#
#     tools/build_cost.sh [--against FOLDER|COMMIT] [--csv FILE] [--folder FOLDER] [--jobs N]
#
#     --against  builds another checkout, or a commit of this one, the same way and prints the ratio
#     --csv      writes checkout,room,file,user_s,system_s: a line a file compiled
#     --folder   keeps the builds there; otherwise in a temporary folder, removed at the end
#     --jobs     compilers at a time, 2 unless told
#
# CPU seconds depend little on what else runs; on a busy machine they are still a few percent too high.
set -euo pipefail
source_root=$(cd "$(dirname "$0")/.." && pwd)

against="" csv="" folder="" jobs=2
while [ $# -gt 0 ]; do
  case "$1" in
    --against) against=$2 ;;
    --csv) csv=$2 ;;
    --folder) folder=$2 ;;
    --jobs) jobs=$2 ;;
    *)
      sed -n '2,12s/^# \{0,1\}//p' "$0" >&2
      exit 2
      ;;
  esac
  shift 2
done
if [ -z "$folder" ]; then
  folder=$(mktemp -d)
  trap 'rm -rf "$folder"' EXIT
fi
mkdir -p "$folder"
folder=$(cd "$folder" && pwd)
[ -z "$csv" ] || echo "checkout,room,file,user_s,system_s" >"$csv"

# Runs a compiler and notes what it took and what it made.
cat >"$folder/launch" <<'LAUNCH'
#!/usr/bin/env bash
previous="" output=""
for word in "$@"; do
  [ "$previous" = -o ] && output=$word
  previous=$word
done
TIMEFORMAT="%U %S $output"
exec 3>&2
{ time "$@" 2>&3; } 2>>"$FORK1S_COST_LOG"
LAUNCH
chmod +x "$folder/launch"

# The room of an object file: a folder of src, a test program, or the folder of the other programs.
rooms='
  function room(path,  part) {
    split(path, part, "/")
    if (path ~ /precompiled/) return "precompiled"
    if (part[1] == "src") return "src/" part[2]
    if (part[1] == "tests") { sub(/^test_/, "", part[3]); sub(/\.dir$/, "", part[3]); return "tests/" part[3] }
    if (part[1] == "apps") return "apps"
    return part[1]
  }'

build() {  # build CHECKOUT NAME: leaves $folder/NAME.log, with "user system object" in every line
  local checkout=$1 name=$2 from=$SECONDS
  echo "build_cost: $name: configuring"
  rm -rf "${folder:?}/$name" "$folder/$name.log"
  cmake -S "$checkout" -B "$folder/$name" -G Ninja -DCMAKE_BUILD_TYPE=Release \
    -DCMAKE_CXX_COMPILER_LAUNCHER="$folder/launch" >"$folder/$name.configured"
  echo "build_cost: $name: building with $jobs at a time"
  local TIMEFORMAT="%U %S"
  : >"$folder/$name.log"
  { time CCACHE_DISABLE=1 FORK1S_COST_LOG="$folder/$name.log" \
    ninja -C "$folder/$name" -j "$jobs" --quiet >"$folder/$name.out" 2>&1; } 2>"$folder/$name.time" || {
    tail -40 "$folder/$name.out" >&2
    exit 1
  }
  echo "build_cost: $name: $((SECONDS - from)) s on the clock"
  [ -z "$csv" ] || awk -v checkout="$name" "$rooms"'
    { printf "%s,%s,%s,%s,%s\n", checkout, room($3), $3, $1, $2 }' "$folder/$name.log" >>"$csv"
}

total() { awk '{ sum += $1 + $2 } END { printf "%.1f", sum }' "$folder/$1.log"; }

report() {  # report NAME
  echo
  echo "$1: CPU seconds by room"
  awk "$rooms"'
    { r = room($3); cost[r] += $1 + $2; files[r]++ }
    END { for (r in cost) printf "%9.1f  %-24s %d compiled\n", cost[r], r, files[r] }' "$folder/$1.log" | sort -rn
  printf '%9s  all compilers\n' "$(total "$1")"
  awk 'NF == 2 { printf "%9.1f  with linking, the page and ninja\n", $1 + $2 }' "$folder/$1.time"
  echo "$1: the ten dearest files"
  awk '{ printf "%9.1f  %s\n", $1 + $2, $3 }' "$folder/$1.log" | sort -rn | sed -n '1,10p'
  echo "$1: files compiled that each public header reaches"
  ninja -C "$folder/$1" -t deps | awk '
    /^[^ ].*: #deps/ { object = $1; next }
    { at = index($1, "include/fork1s/") }
    at { header = substr($1, at + 8); if (!seen[object header]++) reach[header]++ }
    END { for (h in reach) printf "%9d  %s\n", reach[h], h }' | sort -k1,1rn -k2
}

build "$source_root" here
report here
if [ -n "$against" ]; then
  if [ ! -d "$against" ]; then
    commit=$(git -C "$source_root" rev-parse --verify "$against^{commit}")
    mkdir -p "$folder/source"
    git -C "$source_root" archive "$commit" | tar -x -C "$folder/source"
    against=$folder/source
  fi
  build "$(cd "$against" && pwd)" there
  report there
  echo
  awk -v here="$(total here)" -v there="$(total there)" 'BEGIN {
    printf "here %.1f s, there %.1f s of CPU: %.3f of it\n", here, there, here / there }'
fi
