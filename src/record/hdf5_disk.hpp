// Writing HDF5 to a disk that may fail.
//
// HDF5 1.10 does not survive a write that fails: it cannot close the file any more, and on its way out of the
// program it runs in circles or into a segmentation fault. So it never hears of one. This driver keeps the
// file as it is at the first failure, which is how a kill leaves it (the marks of a writer included, so
// readers know), takes all later writes into memory, and tells us.
#pragma once

#include <string>

#include "hdf5_file.hpp"

namespace fork1s::internal {

/// What became of writing. Outlives the file that writes to it.
struct DiskState {
  static constexpr int kCutOff = -1;  // by another program: the file is shorter than what was written
  int error = 0;                      // errno of the first failure, or the above; 0: none
  bool failed() const { return error != 0; }
  /// The system's words for it and what to do.
  std::string Reason() const;
};

/// File access by this driver, in the file format that allows a single writer with many readers.
Hdf5 DiskAccess(DiskState& state);

}  // namespace fork1s::internal
