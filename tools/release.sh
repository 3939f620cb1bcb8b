#!/usr/bin/env bash
# Makes a version: the number in CMakeLists.txt and CITATION.cff, the heading in CHANGELOG.md, ./check, commit and tag, the wheel.
#
#     tools/release.sh VERSION [--no-check]
#
# Nothing leaves this machine; it prints what to push. --no-check: ./check has just passed on this very commit.
set -euo pipefail
cd "$(dirname "$0")/.."
version=${1:-}
if ! [[ "$version" =~ ^[0-9]+\.[0-9]+\.[0-9]+$ ]]; then
  echo "usage: tools/release.sh MAJOR.MINOR.PATCH [--no-check]" >&2
  exit 2
fi
if [ -n "$(git status --porcelain)" ]; then
  echo "release: the working tree has changes; commit or remove them first" >&2
  exit 1
fi
if git rev-parse --quiet --verify "refs/tags/v$version" >/dev/null; then
  echo "release: there is a tag v$version already" >&2
  exit 1
fi
if [ -z "$(sed -n '/^## Unreleased/,/^## [0-9]/{/^- /p}' CHANGELOG.md)" ]; then
  echo "release: CHANGELOG.md has nothing under Unreleased: say what users notice" >&2
  exit 1
fi
[ "${2:-}" = --no-check ] || ./check

sed -i "s/^project(fork1s VERSION [0-9.]*/project(fork1s VERSION $version/" CMakeLists.txt
sed -i "s/^version: .*/version: $version/" CITATION.cff
sed -i "s/^## Unreleased$/## Unreleased\n\n## $version - $(date +%F)/" CHANGELOG.md
git commit --quiet --message "Version $version" CMakeLists.txt CITATION.cff CHANGELOG.md
git tag --annotate "v$version" --message "fork1s $version"
if [ -f build/release/CMakeCache.txt ]; then
  cmake --preset release >/dev/null
  bash tools/wheel.sh --from build/release
fi
echo "release: v$version is committed and tagged; git push --follow-tags makes it public, build/wheel/dist has the wheel"
