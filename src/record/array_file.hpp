// Named arrays as files that other programs open: MAT-files (MATLAB, Octave, SciPy) and NPZ files (NumPy).
#pragma once

#include <fork1s/base/error.hpp>
#include <fork1s/base/types.hpp>
#include <string>
#include <variant>
#include <vector>

namespace fork1s {

/// Numbers by rows: the last index runs fastest.
struct NumberArray {
  std::vector<std::size_t> shape;
  std::vector<double> values;
};
NumberArray ToNumberArray(const MatrixX& matrix);
/// Of one index, a column in MAT-files, whose arrays have two at least.
NumberArray ToNumberArray(const VectorX& vector);

struct NamedArray {
  std::string name;                                        // a letter, then letters, digits and underscores
  std::variant<NumberArray, std::vector<std::string>> of;  // texts: a list, in MAT-files a column of cells
};

/// Version 5 ("Level 5 MAT-File Format", The MathWorks), not compressed, which needs no library. Texts are UTF-8;
/// bytes that are none become U+FFFD. The file appears when it is whole. Errors: kFile, also above 2 GB, where
/// offsets of the format end.
Expected<void> SaveMatFile(const std::vector<NamedArray>& arrays, const std::string& path);

/// A zip file of NPY entries (NEP 1), stored and not compressed. Texts are UTF-32 of one length. Errors likewise.
Expected<void> SaveNpzFile(const std::vector<NamedArray>& arrays, const std::string& path);

}  // namespace fork1s
