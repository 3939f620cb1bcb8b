#!/usr/bin/env bash
# Installs Drake, DART and Bullet, wheels of Python's registry, for `fork1s bench --peers drake,dart,bullet`: 160 MB to fetch and
# a gigabyte in build/peers. Nothing else needs them, neither ./demo nor ./check runs this.
#
#     tools/peers.sh
set -euo pipefail
cd "$(dirname "$0")/.."
work=build/peers
if [ -x "$work/bin/python" ] && cmp -s tools/peers.txt "$work/peers.txt"; then
  echo "peers: installed in $work"
  exit 0
fi
python=""
for name in python3.11 python3; do
  if command -v "$name" >/dev/null && [ "$("$name" -c 'import sys; print(*sys.version_info[:2])')" = "3 11" ]; then
    python=$name
    break
  fi
done
if [ -z "$python" ]; then
  echo "peers: tools/peers.txt names wheels for Python 3.11, and there is none here; install it (Debian bookworm: apt-get install" \
    "python3-venv), or name the wheels of another version in tools/peers.txt" >&2
  exit 1
fi
echo "peers: installing Drake, DART and Bullet into $work"
rm -rf "$work"
"$python" -m venv "$work"
"$work/bin/pip" install --quiet --disable-pip-version-check --no-deps --require-hashes --only-binary=:all: -r tools/peers.txt
for module in pydrake.multibody.plant dartpy pybullet; do
  "$work/bin/python" -c "import $module" >/dev/null || {
    echo "peers: $module does not load on this machine" >&2
    exit 1
  }
done
cp tools/peers.txt "$work/peers.txt"
echo "peers: $("$work/bin/python" -c 'from importlib.metadata import version; print(*(f"{n} {version(n)}" for n in ("drake", "dartpy", "pybullet")), sep=", ")')"
