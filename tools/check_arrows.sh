#!/usr/bin/env bash
# Reads every include between rooms and holds it against the arrows that src/*/CMakeLists.txt state (ROOMS ...),
# closed transitively. An arrow that is used but not stated, or a circle, fails. So does a decomposition
# of a matrix anywhere but in linalg (and in lab/time_stepping, which is code of its own): each file that instantiates one compiles for seconds longer, and ranks are
# decided there. So does an option of the command line in a message of the libraries, which Python and C++ have too. So
# does an include of lab/ in what is installed or shipped.
set -euo pipefail
cd "$(dirname "$0")/.."

declare -A stated closure
for list in src/*/CMakeLists.txt lab/CMakeLists.txt; do
  room=$(basename "$(dirname "$list")")
  stated[$room]=$(tr '\n' ' ' <"$list" | sed -n 's/.*ROOMS \([a-z ]*\).*/\1/p')
done

reach() {  # all rooms below $1; $2 is the way taken, to find circles
  local next
  for next in ${stated[$1]:-}; do
    if [[ " $2 " == *" $next "* ]]; then
      echo "check_arrows: circle: $2 $next" >&2
      exit 1
    fi
    echo "$next"
    reach "$next" "$2 $next"
  done
}

failed=0
for room in "${!stated[@]}"; do
  closure[$room]=" $room $(reach "$room" "$room" | sort -u | tr '\n' ' ')"
  folders=("src/$room" "include/fork1s/$room")
  [ "$room" != lab ] || folders=(lab)
  while IFS=: read -r file line text; do
    used=$(sed -E 's/.*(<fork1s\/|")([a-z]+)\/.*/\2/' <<<"$text")
    [ -n "${stated[$used]+room}" ] || continue  # a folder within the room
    if [[ "${closure[$room]}" != *" $used "* ]]; then
      echo "check_arrows: $file:$line: room '$room' may not look into '$used'" >&2
      failed=1
    fi
  done < <(grep -rnE '#include (<fork1s/|")[a-z]+/' "${folders[@]}" 2>/dev/null || true)
done
decompositions='#include <(Eigen/(Cholesky|Dense|Eigen|Eigenvalues|Householder|LU|QR|SVD|Sparse[A-Z][A-Za-z]*|Jacobi)>|Spectra/)'
decompositions+='|Eigen::[A-Za-z]*(LLT|LDLT|LU|Lu|QR|SVD|EigenSolver|OrthogonalDecomposition)\b'
decompositions+='|\.(llt|ldlt|lu|partialPivLu|fullPivLu|householderQr|colPivHouseholderQr|jacobiSvd|bdcSvd|completeOrthogonalDecomposition)\(\)'
if found=$(grep -rnE "$decompositions" --include='*.cpp' --include='*.hpp' include src apps benchmarks examples lab tests |
  grep -vE '^(src/linalg/|include/fork1s/linalg/|lab/time_stepping/)|<Eigen/SparseCore>'); then
  echo "$found" | sed 's/^/check_arrows: decompositions belong in linalg: /' >&2
  failed=1
fi
if found=$(grep -rnE 'BDCSVD|bdcSvd' --include='*.cpp' --include='*.hpp' src include apps benchmarks examples | grep -v '//'); then
  echo "$found" | sed 's/^/check_arrows: BDCSVD gives wrong vectors, take linalg: /' >&2
  failed=1
fi
if found=$(grep -rnE '^[^/]*"([^"]*[ (;])?--[a-z]' --include='*.cpp' --include='*.hpp' src include |
  grep -v '^src/study/bench/instructions.cpp'); then  # that one runs valgrind
  echo "$found" | sed 's/^/check_arrows: an option of the command line in a library: /' >&2
  failed=1
fi
if found=$(grep -rnE '#include [<"](\.\./)*lab/' --include='*.cpp' --include='*.hpp' src include apps bindings examples); then
  echo "$found" | sed 's/^/check_arrows: lab is for measurements of the project alone: /' >&2
  failed=1
fi
[ "$failed" -eq 0 ] && echo "check_arrows: every include follows the stated arrows (${#stated[@]} rooms)"
exit "$failed"
