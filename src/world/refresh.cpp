#include "refresh.hpp"

namespace fork1s {
namespace {

void GatherContactImpulses(std::size_t i, const MechanismDynamics& m, const Detection& detection,
                           const ConstraintRows& rows, RefreshState& refresh) {
  refresh.contact_impulses_R.setZero(6, m.mechanism().num_bodies());
  for (std::size_t c = 0; c < detection.collision_bodies.size(); ++c) {
    const CollisionBody& collision_body = detection.collision_bodies[c];
    if (collision_body.kind != CollisionBody::Kind::kGroup || collision_body.index != static_cast<int>(i) ||
        rows.port_offset[c] < 0 || !rows.is_pushed[c])
      continue;
    const PartRows& part = rows.mechanisms[i].parts[static_cast<std::size_t>(rows.port_part[c])];
    const BodyIndex body = m.groups()[static_cast<std::size_t>(collision_body.group)].body;
    refresh.contact_impulses_R.col(body.value()) +=
        part.impulse.segment<6>(rows.port_offset[c] - part.offset);
  }
}

}  // namespace

void RefreshIfStale(std::size_t i, double h, const Detection& detection, const ConstraintRows& rows,
                    MechanismDynamics& m, RefreshState& refresh) {
  refresh.result = 0;
  refresh.drift = m.ComputeLinearizationDrift();
  refresh.by_expansion = m.went_by_expansion();
  refresh.expanded = !(refresh.drift.share > 1) && UpdateExpansion(m, h);
  if (!(refresh.drift.share > 1) && m.model().has_complement && (refresh.expanded || !refresh.by_expansion)) {
    GatherContactImpulses(i, m, detection, rows, refresh);
    refresh.drift = FindMissingLoad(m, h, refresh.contact_impulses_R);
  }
  if (!(refresh.drift.share > 1)) return;
  refresh.result = m.Refresh() ? 1 : -1;
}

void ExpandIfFar(double h, MechanismDynamics& m, RefreshState& refresh) {
  refresh.result = 0;
  refresh.by_expansion = m.went_by_expansion();
  refresh.expanded = UpdateExpansion(m, h);
}

void CountRefreshes(const std::vector<RefreshState>& refreshes, StepReport& report) {
  for (std::size_t i = 0; i < refreshes.size(); ++i) {
    const RefreshState& refresh = refreshes[i];
    report.failed_refreshes += refresh.result < 0 ? 1 : 0;
    report.by_expansion += refresh.by_expansion ? 1 : 0;
    report.expansions += refresh.expanded ? 1 : 0;
    if (refresh.result <= 0) continue;
    const LinearizationDrift& drift = refresh.drift;
    ++report.refreshes;
    Relinearizations& of_cause = report.refreshes_by_cause[static_cast<std::size_t>(drift.cause)];
    ++of_cause.count;
    if (!(drift.share > of_cause.largest.share)) continue;
    of_cause.largest = drift;
    of_cause.of = {drift.coordinate < 0 ? StepSubject::Kind::kMechanism : StepSubject::Kind::kCoordinate,
                   static_cast<int>(i), drift.coordinate};
  }
}

}  // namespace fork1s
