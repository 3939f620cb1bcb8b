#!/usr/bin/env bash
# Builds the site of docs/ in build/site, strictly: links and anchors that lead nowhere fail, and so do pages that the
# navigation has forgotten.
#
#     tools/docs.sh [--from BUILD]      BUILD has the Python package; default: build/release
#     tools/docs.sh --serve             on this machine, anew whenever a page is saved
set -euo pipefail
cd "$(dirname "$0")/.."
build=build/release serve=""
case "${1:-}" in
--from) build=$2 ;;
--serve) serve=yes ;;
esac
package=$build/bindings/python
if [ ! -f "$package/fork1s/_core.pyi" ]; then
  echo "docs: $package has no Python package, whose reference is part of the site; build it first (./check)" >&2
  exit 1
fi
work=build/docs
# Tools stay, as they are pinned; a change of their versions makes them anew.
if ! cmp -s tools/docs.txt "$work/tools.txt" || [ ! -x "$work/tools/bin/python" ]; then
  echo "docs: installing its tools into $work/tools"
  rm -rf "$work"
  python3 -m venv "$work/tools"
  "$work/tools/bin/pip" install --quiet --disable-pip-version-check --no-compile --require-hashes -r tools/docs.txt
  cp tools/docs.txt "$work/tools.txt"
fi
export FORK1S_PACKAGE=$package NO_MKDOCS_2_WARNING=1
if [ -n "$serve" ]; then
  exec "$work/tools/bin/mkdocs" serve
fi
"$work/tools/bin/mkdocs" build --strict --quiet
echo "docs: build/site/index.html, $(find build/site -name '*.html' | wc -l) pages"
