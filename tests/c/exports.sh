#!/usr/bin/env bash
# Compares the symbols that a library exports with the functions that a header declares: exports.sh LIBRARY HEADER.
set -euo pipefail
diff <(grep -oE '\bfork1s_[a-z_]+\(' "$2" | tr -d '(' | sort -u) \
  <(nm -D --defined-only "$1" | awk '{print $3}' | sed 's/@.*//' | sort -u) ||
  { echo "exports: < is declared and not exported, > is exported and not declared" >&2; exit 1; }
