#!/usr/bin/env bash
# Builds the site of docs/ in build/site, strictly: links and anchors that lead nowhere fail, and so do pages that the
# navigation has forgotten, notebooks of which a cell fails, and searches of the site that do not find what they should.
#
#     tools/docs.sh [--from BUILD]      BUILD has the Python package; default: build/release
#     tools/docs.sh --serve             on this machine, again whenever a page is saved
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
# Tools stay, as they are pinned; a change of their versions makes them again.
if ! cmp -s tools/docs.txt "$work/tools.txt" || [ ! -x "$work/tools/bin/python" ]; then
  echo "docs: installing its tools into $work/tools"
  rm -rf "$work"
  python3 -m venv "$work/tools"
  "$work/tools/bin/pip" install --quiet --disable-pip-version-check --no-compile --require-hashes -r tools/docs.txt
  cp tools/docs.txt "$work/tools.txt"
fi
# The package as a wheel has it, with its scenes.
rm -rf "$work/package" "$work/notebooks"
cmake --install "$build" --component python --prefix "$work/package" >/dev/null
export FORK1S_PACKAGE=$work/package FORK1S_NOTEBOOKS=$PWD/$work/notebooks NO_MKDOCS_2_WARNING=1
# Debuggers and the user's own settings are none of theirs.
PYTHONPATH=$PWD/$work/package PYDEVD_DISABLE_FILE_VALIDATION=1 JUPYTER_CONFIG_DIR=$PWD/$work/jupyter \
  IPYTHONDIR=$PWD/$work/ipython MPLCONFIGDIR=$PWD/$work/matplotlib MPLBACKEND=module://matplotlib_inline.backend_inline \
  "$work/tools/bin/python" tools/notebooks.py "$work/notebooks"
if [ -n "$serve" ]; then
  exec "$work/tools/bin/mkdocs" serve
fi
"$work/tools/bin/mkdocs" build --strict --quiet
echo "docs: build/site/index.html, $(find build/site -name '*.html' | wc -l) pages"
if [ -d "$build/viewer/work/node_modules/playwright-core" ] && ls /usr/bin/chromium* >/dev/null 2>&1; then
  node tools/search_docs.mjs build/site "$build/viewer/work"
else
  echo "docs: the search of the site is not tried, which needs the viewer's build and chromium"
fi
