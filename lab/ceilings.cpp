#include <lab/ceilings.hpp>

#include <algorithm>
#include <chrono>
#include <numeric>

#include "fused_sums.hpp"
#include "parallel/parallel_for.hpp"

namespace fork1s {
namespace {

using Four = double __attribute__((vector_size(32)));
struct FourDoubles {
  Four v;
};

double SecondsSince(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

// The best of some tries, as what disturbs only takes time.
template <class Work>
double BestSeconds(int tries, Work work) {
  double best = 1e300;
  for (int i = 0; i < tries; ++i) {
    const auto start = std::chrono::steady_clock::now();
    work();
    best = std::min(best, SecondsSince(start));
  }
  return best;
}

}  // namespace

Ceilings MeasureCeilings(double bytes, int threads, bool single_precision) {
  Ceilings out;
  constexpr int kRounds = 100000, kTries = 25;
  const auto count = static_cast<std::size_t>(std::max(1.0, bytes / (3 * sizeof(Four))));
  std::vector<FourDoubles> a(count), b(count, {Four{1, 2, 3, 4}}), c(count, {Four{5, 6, 7, 8}}),
      all(3 * count);
  std::vector<double> kept(static_cast<std::size_t>(threads)), operations(kept.size());
  const int repeats = static_cast<int>(std::max(1.0, 1e7 / bytes));
  const Four s{0.5, 0.5, 0.5, 0.5};
  WithThreads(threads, [&] {
    const double arithmetic = BestSeconds(kTries, [&] {
      ParallelFor(0, threads, 1, [&](int begin, int end) {
        for (int i = begin; i < end; ++i)
          operations[static_cast<std::size_t>(i)] =
              internal::FusedSums(single_precision, kRounds, kept[static_cast<std::size_t>(i)]);
      });
    });
    out.gigaflops = 1e-9 * std::accumulate(operations.begin(), operations.end(), 0.0) / arithmetic;
    const double memory = BestSeconds(kTries, [&] {
      ParallelFor(0, threads, 1, [&](int begin, int end) {
        const std::size_t first = count * static_cast<std::size_t>(begin) / static_cast<std::size_t>(threads),
                          last = count * static_cast<std::size_t>(end) / static_cast<std::size_t>(threads);
        for (int r = 0; r < repeats; ++r) {
          for (std::size_t i = first; i < last; ++i) a[i].v = b[i].v + s * c[i].v;
          b[first] = a[last - 1];  // so that no repeat is left out
        }
      });
    });
    const double reading = BestSeconds(kTries, [&] {
      ParallelFor(0, threads, 1, [&](int begin, int end) {
        const std::size_t first =
                              3 * count * static_cast<std::size_t>(begin) / static_cast<std::size_t>(threads),
                          last =
                              3 * count * static_cast<std::size_t>(end) / static_cast<std::size_t>(threads);
        for (int r = 0; r < repeats; ++r) {
          // So that no repeat is left out.
          all[first].v[0] = internal::SumOfAll(&all[first].v[0], 4 * (last - first));
        }
      });
    });
    out.gigabytes_per_s =
        1e-9 * 3 * sizeof(Four) * static_cast<double>(count) * repeats / std::min(memory, reading);
  });
  volatile double used = kept.front() + a.front().v[0];
  static_cast<void>(used);
  return out;
}

}  // namespace fork1s
