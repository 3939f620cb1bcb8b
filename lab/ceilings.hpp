// What this machine does at most, measured by two kernels.
#pragma once

namespace fork1s {

struct Ceilings {
  double gigabytes_per_s =
      0;                 // a triad a = b + s c over as many bytes, or reading them, whichever is the more
  double gigaflops = 0;  // fused products and sums in registers, two operations each
};
Ceilings MeasureCeilings(double bytes, int threads, bool single_precision = false);

}  // namespace fork1s
