#include <filesystem>
#include <fstream>
#include <lab/accuracy.hpp>
#include <utility>

#include "results.hpp"

namespace fork1s {
namespace internal {
namespace {

// The sheet stands on two men whose other freedoms it does not feel: how many of them the model keeps
// matters.
Expected<void> MeasureTruncation(const StaticCase& firemen, AccuracyResults& out) {
  out.truncation_angles_deg = {5, 10, 20};
  for (int k : {0, 4, 8, 16, 36}) {
    MechanismDef definition = firemen.mechanism->definition();
    definition.modes = k;
    auto built = BuildMechanism(std::move(definition));
    if (!built) return tl::unexpected(built.error());
    StaticCase c = firemen;
    c.mechanism = std::make_shared<const Mechanism>(std::move(*built));
    auto model = Reduce(c.mechanism, c.q0);
    if (!model) return tl::unexpected(model.error());
    auto curve = MeasureStatics(c, out.truncation_angles_deg, {StaticMode::kExact});
    if (!curve) return tl::unexpected(curve.error());
    AccuracyResults::Truncation row{model->num_modes, model->size(), {}};
    for (const StaticCurve::Point& p : curve->points) row.percent.push_back(p.percent[0]);
    out.truncation.push_back(std::move(row));
  }
  return {};
}

}  // namespace

Expected<AccuracyResults> MeasureAccuracy(const std::string& scenes) {
  AccuracyResults out;
  auto cases = MakeStaticCases(scenes);
  if (!cases) return tl::unexpected(cases.error());
  for (const StaticCase& c : *cases) {
    // On a tree there is no loop to leave open.
    const bool tree = c.mechanism->num_constraints() == 0;
    std::vector<StaticMode> modes{StaticMode::kTwist, StaticMode::kSecondOrder};
    if (!tree) modes.insert(modes.end(), {StaticMode::kOpen, StaticMode::kCurved});
    modes.insert(modes.end(), {StaticMode::kExact, StaticMode::kRefreshed});
    auto curve = MeasureStatics(c, {0.5, 1, 2, 5, 10, 20, 30, 45}, modes);
    if (!curve) return tl::unexpected(curve.error());
    out.statics.push_back(std::move(*curve));
    auto gaps = MeasureGaps(c, {0.5, 1, 2, 5, 10, 20, 30, 45});
    if (!gaps) return tl::unexpected(gaps.error());
    out.gaps.push_back(std::move(*gaps));
    if (c.name != "firemen") continue;
    if (auto ok = MeasureTruncation(c, out); !ok) return tl::unexpected(ok.error());
  }
  auto rest_cases = MakeRestCases(scenes);
  if (!rest_cases) return tl::unexpected(rest_cases.error());
  for (const RestCase& c : *rest_cases)
    for (const DeflectionLoad load : kDeflectionLoads) {
      auto curve = MeasureRest(c, load, {5, 15, 30});
      if (!curve) return tl::unexpected(curve.error());
      out.rests.push_back(std::move(*curve));
    }
  auto frequency_cases = MakeFrequencyCases(scenes);
  if (!frequency_cases) return tl::unexpected(frequency_cases.error());
  for (const StaticCase& c : *frequency_cases)
    for (ModeChoice choice : {ModeChoice::kLowest, ModeChoice::kContribution}) {
      auto curve = MeasureFrequencies(c, {0, 1, 2, 3, 4, 5, 6, 7, 8, 10, 12}, choice);
      if (!curve) return tl::unexpected(curve.error());
      out.frequencies.push_back(std::move(*curve));
    }
  auto transient_cases = MakeTransientCases(scenes);
  if (!transient_cases) return tl::unexpected(transient_cases.error());
  for (const TransientCase& c : *transient_cases) {
    auto curve = MeasureTransient(c, 4);  // 1/60 s to 1/960 s
    if (!curve) return tl::unexpected(curve.error());
    out.transients.push_back(std::move(*curve));
    auto estimates = MeasureErrorEstimate(c, {Integrator::kEuler, Integrator::kTwoStage}, 8);
    if (!estimates) return tl::unexpected(estimates.error());
    for (ErrorEstimateCurve& e : *estimates) out.estimates.push_back(std::move(e));
    if (c.name != "firemen") continue;
    for (auto [modes, place] : {std::pair{0, &out.firemen_without_modes}, {36, &out.firemen_with_all}}) {
      TransientCase other = c;
      other.scene.mechanisms[0].modes = modes;
      auto measured = MeasureTransient(other, 3);
      if (!measured) return tl::unexpected(measured.error());
      *place = std::move(*measured);
    }
  }
  auto families = MeasureErrorFamilies({std::begin(kErrorFamilies), std::end(kErrorFamilies)}, 1001, 160,
                                       ErrorTruth::kAllModes);
  if (!families) return tl::unexpected(families.error());
  out.families = std::move(*families);
  return out;
}

Expected<void> WriteText(const std::string& path, const std::string& text) {
  std::ofstream file(path, std::ios::binary);
  file << text;
  file.close();
  if (!file) return Fail(ErrorCode::kFile, path, "cannot be written");
  return {};
}

}  // namespace internal

Expected<void> WriteAccuracyPage(const std::string& scenes, const std::string& folder) {
  auto results = internal::MeasureAccuracy(scenes);
  if (!results) return tl::unexpected(results.error());
  std::error_code error;
  std::filesystem::create_directories(folder + "/accuracy", error);
  if (error) return Fail(ErrorCode::kFile, folder + "/accuracy", error.message());
  if (auto ok = internal::WriteAccuracyPlots(*results, folder + "/accuracy"); !ok) return ok;
  if (auto ok = internal::WriteAccuracyTables(*results, folder + "/accuracy"); !ok) return ok;
  return internal::WriteText(folder + "/accuracy.md", internal::AccuracyPage(*results));
}

}  // namespace fork1s
