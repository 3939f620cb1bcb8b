// Tables of control values.
#include <fork1s/record/csv.hpp>

#include "files.hpp"
#include "fuzz.hpp"

FORK1S_FUZZ_TARGET(controls, 5000) {
  using fork1s::fuzz::Demand;
  const auto track =
      fork1s::ReadControls(fork1s::fuzz::WriteScratch("controls.csv", fork1s::fuzz::Text(input)));
  if (!track) return fork1s::fuzz::DemandNamed(track.error());
  Demand(!track->times.empty() && track->times.size() == track->rows.size(), "a table has a time a row");
  for (std::size_t i = 0; i < track->rows.size(); ++i) {
    Demand(std::isfinite(track->times[i]) && (i == 0 || track->times[i] > track->times[i - 1]), "times rise");
    Demand(track->rows[i].size() == track->names.size(), "a row has a value a name");
    for (double value : track->rows[i]) Demand(std::isfinite(value), "values are finite");
  }
}
