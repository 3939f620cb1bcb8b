#!/usr/bin/env bash
# Formats C++ (clang-format-16, .clang-format) and Python (ruff, pyproject.toml), and checks Python (ruff), shell scripts
# (shellcheck), spelling (codespell) and, without FILE, words that are unknown in src and include (tools/words.py).
#
#     tools/format.sh [--check] [FILE...]     all files unless named; --check changes none
#
# The exit code is 1 where a file has to change. tools/setup.sh format installs clang-format-16, shellcheck
# and the lists of English words; ruff and codespell are pinned in tools/format.txt and installed in build/format.
set -euo pipefail
started=$SECONDS
check=""
if [ "${1:-}" = --check ]; then
  check=yes
  shift
fi
case "${1:-}" in
  -*) echo "format: there is no option '$1'; there is --check" >&2; exit 2 ;;
esac
files=()
for file in "$@"; do files+=("$(realpath "$file")"); done
cd "$(dirname "$0")/.."

for program in clang-format-16 shellcheck; do
  command -v "$program" >/dev/null || {
    echo "format: $program is missing; install it by: bash tools/setup.sh format" >&2
    exit 1
  }
done
work=build/format
if ! cmp -s tools/format.txt "$work/tools.txt" || [ ! -x "$work/tools/bin/ruff" ]; then
  echo "format: installing ruff and codespell into $work/tools"
  rm -rf "$work"
  python3 -m venv "$work/tools"
  "$work/tools/bin/pip" install --quiet --disable-pip-version-check --require-hashes --only-binary :all: \
    -r tools/format.txt
  cp tools/format.txt "$work/tools.txt"
fi
tools=$PWD/$work/tools/bin

if [ ${#files[@]} -eq 0 ]; then
  mapfile -t files < <(find "$PWD" \( -path "$PWD/build" -o -path "$PWD/out" -o -name .git -o -name node_modules \
    -o -name dist -o -name venv -o -name .venv -o -name '.*cache' \) -prune -o -type f -print | LC_ALL=C sort)
fi
cpp=() python=() shell=() text=()
for file in "${files[@]}"; do
  case "$file" in
    */tests/fuzz/corpus/*) continue ;;
    *.cpp | *.hpp | *.c | *.h) cpp+=("$file") ;;
    *.py | *.pyi) python+=("$file") ;;
    *.sh | */check | */demo | */.ci/run) shell+=("$file") ;;
    *.md | *.ts | *.mjs | *.css | *.html | *.glsl | *.cmake | */CMakeLists.txt | *.toml | *.yml | *.yaml) ;;
    *) continue ;;
  esac
  text+=("$file")
done

failed=""
if [ ${#cpp[@]} -gt 0 ]; then
  change=(-i)
  [ -z "$check" ] || change=(--dry-run -Werror --ferror-limit=1)
  printf '%s\0' "${cpp[@]}" | xargs -0 -n 16 -P "$(nproc)" clang-format-16 "${change[@]}" || failed=yes
fi
if [ ${#python[@]} -gt 0 ]; then
  fix=--fix
  [ -z "$check" ] || fix=--no-fix
  "$tools/ruff" check --quiet "$fix" "${python[@]}" || failed=yes
  "$tools/ruff" format --quiet ${check:+--diff} "${python[@]}" || failed=yes
fi
[ ${#shell[@]} -eq 0 ] || shellcheck --severity=info "${shell[@]}" || failed=yes
[ ${#text[@]} -eq 0 ] || "$tools/codespell" "${text[@]}" || failed=yes
# 77: it says what it lacks.
[ $# -gt 0 ] || python3 -B tools/words.py --check || [ $? -eq 77 ] || failed=yes
if [ -n "$failed" ]; then
  echo "format: files are to change, see above; tools/format.sh changes the layout of C++ and Python" >&2
  exit 1
fi
echo "format: C++ ${#cpp[@]}, Python ${#python[@]}, shell ${#shell[@]} files are formatted; spelling of ${#text[@]} checked, in $((SECONDS - started)) s"
