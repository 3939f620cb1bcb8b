// For one file of a test program that reads damaged files: what libraries of others leak of them is no
// finding.
//
// Assimp and HDF5 forget what they had begun where a file ends in damage. What such a library holds of whole
// files, and all that is ours, the leak sanitizer reports still: a handle of HDF5 that nobody closes is
// reached by its tables, and Assimp gives out nothing that it does not own.
#pragma once

extern "C" const char* __lsan_default_suppressions() { return "leak:libassimp\nleak:libhdf5\n"; }
