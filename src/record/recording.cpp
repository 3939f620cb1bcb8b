#include <cmath>
#include <fork1s/record/recording.hpp>

#include "recording_file.hpp"
#include "step_reader.hpp"

namespace fork1s {

using namespace internal;

Expected<Recording> Recording::Open(const std::string& path) {
  return Guarded(path, [&]() -> Expected<Recording> {
    auto open = OpenRecordingFile(path);
    if (!open) return tl::unexpected(open.error());
    Recording recording;
    recording.header_ = std::move(open->header);
    StepReader reader(open->file.id(), recording.header_, open->facts);
    recording.data_ = reader.Next(reader.steps());
    return recording;
  });
}

RigidTransform Recording::Pose(int step, int body) const {
  FORK1S_REQUIRE(step >= -1 && step < num_steps(), step);
  FORK1S_REQUIRE(body >= 0 && body < static_cast<int>(bodies().size()), body);
  const std::vector<double>& poses = step < 0 ? header_.initial_poses : data_.poses;
  const std::size_t row = step < 0 ? 0 : static_cast<std::size_t>(step);
  const double* p = &poses[7 * (row * bodies().size() + static_cast<std::size_t>(body))];
  return {Quaternion(p[3], p[4], p[5], p[6]), Vector3(p[0], p[1], p[2])};
}

VectorX Recording::Controls(int step) const {
  FORK1S_REQUIRE(step >= 0 && step < num_steps(), step);
  const auto n = static_cast<Eigen::Index>(header_.control_names.size());
  return Eigen::Map<const VectorX>(data_.controls.data() + step * n, n);
}

VectorX Recording::BaseRates(int step) const {
  FORK1S_REQUIRE(step >= 0 && step < num_steps(), step);
  const auto n = static_cast<Eigen::Index>(data_.base_rates.size()) / num_steps();
  return Eigen::Map<const VectorX>(data_.base_rates.data() + step * n, n);
}

VectorX Recording::Coordinates(int step) const {
  FORK1S_REQUIRE(step >= 0 && step < num_steps(), step);
  const auto n = static_cast<Eigen::Index>(header_.coordinate_names.size());
  return Eigen::Map<const VectorX>(data_.coordinates.data() + step * n, n);
}

// First row and number of rows of a mechanism in /reduced.
std::array<std::size_t, 2> Recording::ReducedRange(int step, int mechanism) const {
  const auto m = header_.scene.mechanisms.size();
  FORK1S_REQUIRE(step >= 0 && step < num_steps(), step);
  FORK1S_REQUIRE(mechanism >= 0 && mechanism < static_cast<int>(m), mechanism);
  const auto i = static_cast<std::size_t>(step);
  std::size_t first = i > 0 ? static_cast<std::size_t>(data_.reduced_end[i - 1]) : 0;
  const int* sizes = &data_.reduced_sizes[i * m];
  for (int k = 0; k < mechanism; ++k) first += static_cast<std::size_t>(sizes[k]);
  return {first, static_cast<std::size_t>(sizes[mechanism])};
}

VectorX Recording::ReducedCoordinates(int step, int mechanism) const {
  const auto [first, size] = ReducedRange(step, mechanism);
  return Eigen::Map<const VectorX>(data_.z.data() + first, static_cast<Eigen::Index>(size));
}

VectorX Recording::ReducedRates(int step, int mechanism) const {
  const auto [first, size] = ReducedRange(step, mechanism);
  return Eigen::Map<const VectorX>(data_.w.data() + first, static_cast<Eigen::Index>(size));
}

std::vector<RecordedContact> Recording::Contacts(int step) const {
  FORK1S_REQUIRE(step >= 0 && step < num_steps(), step);
  const auto i = static_cast<std::size_t>(step);
  std::vector<RecordedContact> contacts;
  auto triple = [](const std::vector<double>& v, std::size_t row) {
    return Vector3(Eigen::Map<const Vector3>(&v[3 * row]));
  };
  for (auto c = static_cast<std::size_t>(i > 0 ? data_.contact_end[i - 1] : 0);
       c < static_cast<std::size_t>(data_.contact_end[i]); ++c)
    contacts.push_back({data_.contact_body_a[c], data_.contact_body_b[c], triple(data_.contact_point, c),
                        triple(data_.contact_normal, c), triple(data_.contact_force, c), data_.contact_gap[c],
                        data_.contact_friction[c]});
  return contacts;
}

std::vector<AppliedWrench> Recording::Wrenches(int step) const {
  FORK1S_REQUIRE(step >= 0 && step < num_steps(), step);
  const auto i = static_cast<std::size_t>(step);
  std::vector<AppliedWrench> wrenches;
  for (auto k = static_cast<std::size_t>(i > 0 ? data_.wrench_end[i - 1] : 0);
       k < static_cast<std::size_t>(data_.wrench_end[i]); ++k) {
    const double* v = &data_.wrench[9 * k];
    wrenches.push_back({data_.wrench_body[k], Vector3(v[0], v[1], v[2]), Vector3(v[3], v[4], v[5]),
                        Vector3(v[6], v[7], v[8])});
  }
  return wrenches;
}

std::vector<Simulation::BodyPointSpring> Recording::PointSprings(int step) const {
  FORK1S_REQUIRE(step >= 0 && step < num_steps(), step);
  const auto i = static_cast<std::size_t>(step);
  std::vector<Simulation::BodyPointSpring> springs;
  for (auto k = static_cast<std::size_t>(i > 0 ? data_.point_spring_end[i - 1] : 0);
       k < static_cast<std::size_t>(data_.point_spring_end[i]); ++k) {
    const double* v = &data_.point_spring[11 * k];
    springs.push_back(
        {data_.point_spring_body[k],
         {Vector3(v[0], v[1], v[2]), Vector3(v[3], v[4], v[5]), Vector3(v[6], v[7], v[8]), v[9], v[10]}});
  }
  return springs;
}

StepReport Recording::Report(int step) const {
  FORK1S_REQUIRE(step >= 0 && step < num_steps(), step);
  const auto i = static_cast<std::size_t>(step);
  StepReport r;
  r.contacts = data_.contacts[i];
  r.limits = data_.limits[i];
  r.solver.newton_iterations = data_.newton_iterations[i];
  r.solver.fallback = data_.contact_stage[i];
  r.solver.residual = data_.residual[i];
  r.solver.converged = r.stages_converged = data_.converged[i] != 0;
  r.max_penetration = data_.max_penetration[i];
  r.refreshes = data_.refreshes[i];
  r.failed_refreshes = data_.failed_refreshes[i];
  r.contacts_dropped = data_.contacts_dropped[i] != 0;
  r.finite = data_.finite[i] != 0;
  return r;
}

Fidelity Recording::FidelityOf(int step) const {
  FORK1S_REQUIRE(step >= 0 && step < num_steps(), step);
  const auto i = static_cast<std::size_t>(step);
  FORK1S_REQUIRE(data_.detail[i] <= static_cast<std::uint8_t>(DetailLevel::kAll), "no level of detail");
  FORK1S_REQUIRE(data_.recovery[i] < kNumRecoveries, "no recovery");
  return {static_cast<DetailLevel>(data_.detail[i]), data_.modes[i],
          static_cast<Recovery>(data_.recovery[i])};
}

std::vector<std::size_t> FirstOfEachFrame(const std::vector<double>& times, double fps) {
  constexpr double kRounding = 1e-6;  // frames: a time on a frame must not slip behind it
  std::vector<std::size_t> chosen;
  double wanted = 0;  // frames since the first
  for (std::size_t i = 0; i < times.size(); ++i) {
    const double frame = (times[i] - times[0]) * fps;
    if (fps > 0 && frame < wanted - kRounding) continue;
    wanted = std::floor(frame + kRounding) + 1;
    chosen.push_back(i);
  }
  return chosen;
}

}  // namespace fork1s
