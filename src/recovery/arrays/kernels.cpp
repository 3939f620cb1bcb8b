// Compiled once for every instruction set that Highway knows here, from this one source; which of them runs
// is decided by the processor. All kernels together, since reading Highway takes longer than any of them.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "recovery/arrays/kernels.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "twist_kernels-inl.hpp"

#include "chain_kernels-inl.hpp"
#include "loop_kernels-inl.hpp"
#include "scan_kernels-inl.hpp"
