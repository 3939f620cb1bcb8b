// The kernels that the precompiled header promises. Compiled without it, as it holds the promises only.
#define FORK1S_KERNEL template
#include "eigen_kernels.hpp"
