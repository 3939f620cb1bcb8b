#!/usr/bin/env bash
# Builds targets and says how far it is: one line that changes on a terminal, a line every 15 s elsewhere. What
# compilers say is shown when something fails.
#
#     tools/build.sh WHO PRESET [TARGET...]        WHO begins every line
set -euo pipefail
cd "$(dirname "$0")/.."
who=$1 preset=$2
shift 2
targets=()
[ $# -eq 0 ] || targets=(--target "$@")

terminal=""
[ ! -t 1 ] || terminal=yes
started=$SECONDS said=$SECONDS
show() {  # show DONE OF
  if [ -n "$terminal" ]; then
    printf '\r%s: %s of %s built, %d s ' "$who" "$1" "$2" $((SECONDS - started))
  elif [ $((SECONDS - said)) -ge 15 ]; then
    said=$SECONDS
    printf '%s: %s of %s built, %d s\n' "$who" "$1" "$2" $((SECONDS - started))
  fi
}

# Ninja begins the line of every finished step with its status; all else comes from compilers.
done_steps=0 all_steps=0
NINJA_STATUS='@built %f %t@' cmake --build --preset "$preset" "${targets[@]}" 2>&1 | {
  while IFS= read -r line; do
    if [[ $line =~ ^@built\ ([0-9]+)\ ([0-9]+)@ ]]; then
      done_steps=${BASH_REMATCH[1]} all_steps=${BASH_REMATCH[2]}
      show "$done_steps" "$all_steps"
    elif [ "$line" != "ninja: no work to do." ]; then
      printf '%s%s\n' "${terminal:+$'\r'}" "$line"
    fi
  done
  if [ "$all_steps" -gt 0 ]; then
    [ -z "$terminal" ] || printf '\r'
    printf '%s: %s of %s built in %d s\n' "$who" "$done_steps" "$all_steps" $((SECONDS - started))
  fi
}
