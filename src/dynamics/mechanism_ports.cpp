// What contacts see of a mechanism: parts that move independently, the twists of its contact groups.
#include <fork1s/dynamics/mechanism_dynamics.hpp>

#include <algorithm>
#include <fork1s/linalg/in_place.hpp>

namespace fork1s {

// Parts are runs of velocities: what a finger on a held palm moves by stands together.
void MechanismDynamics::FindParts() {
  const int r = model().size(), nx = num_velocities();
  std::vector<int> reach(static_cast<std::size_t>(std::max(nx, 1)));
  for (std::size_t i = 0; i < reach.size(); ++i) reach[i] = static_cast<int>(i);
  auto join = [&](int first, int last) {
    if (first <= last)
      reach[static_cast<std::size_t>(first)] = std::max(reach[static_cast<std::size_t>(first)], last);
  };
  // Columns that move a joint at any pose.
  const auto of_joint = [&](int joint) {
    return joint < 0 ? Part{} : Part{jacobian_.begin(joint), jacobian_.size(joint)};
  };
  const auto of_length = [&](const Mechanism::Length& length) {
    int first = r, last = -1;
    for (const int i : mechanism().CoordinatesOf(length)) {
      const Part run = of_joint(mechanism().CoordinateJoint(i).value());
      if (run.size == 0) continue;
      first = std::min(first, run.begin);
      last = std::max(last, run.begin + run.size - 1);
    }
    return last < 0 ? Part{} : Part{first, last + 1 - first};
  };
  std::vector<Part> of_group, of_limited, of_friction;
  for (const ContactGroup& g : groups_) of_group.push_back(of_joint(g.last_joint));
  for (const auto& l : length_limits_) of_limited.push_back(of_length(l.length));
  for (const auto& f : mechanism().frictions()) of_friction.push_back(of_length(f.length));
  if (base_size_ > 0) {
    join(0, nx - 1);
  } else {
    const auto join_run = [&](const Part& run) { join(run.begin, run.begin + run.size - 1); };
    for (int j = 0; j < mechanism().num_joints(); ++j) join_run(of_joint(j));
    for (int i = 0; i < r; ++i)
      for (int j = r - 1; j > i; --j)
        if (model().D(i, j) != 0) {
          join(i, j);
          break;
        }
    for (const auto* runs : {&of_limited, &of_friction})
      for (const Part& run : *runs) join_run(run);
    for (const auto& f : mechanism().force_limits()) join_run(of_length(f.length));
    // Springs of paths turn in A as the pose does, and those that are not linear stiffen.
    for (const auto& s : mechanism().springs())
      if (s.length.path >= 0 || !s.is_linear()) join_run(of_length(s.length));
  }
  parts_.clear();
  std::vector<int> part_of(static_cast<std::size_t>(nx), 0);
  for (int i = 0; i < nx;) {
    int last = reach[static_cast<std::size_t>(i)];
    for (int j = i; j <= last; ++j) last = std::max(last, reach[static_cast<std::size_t>(j)]);
    for (int j = i; j <= last; ++j) part_of[static_cast<std::size_t>(j)] = static_cast<int>(parts_.size());
    parts_.push_back({i, last + 1 - i});
    i = last + 1;
  }
  std::vector<DiagonalBlock> blocks;
  for (const Part& part : parts_) blocks.push_back({part.begin, part.size});
  inertia_factor_ = Cholesky();
  inertia_factor_.Divide(blocks, true);
  factor_.Divide(std::move(blocks), true);
  auto part_of_run = [&](const Part& run) {
    if (base_size_ > 0) return 0;
    return run.size == 0 ? -1 : part_of[static_cast<std::size_t>(run.begin)];
  };
  part_of_group_.clear();
  part_of_limited_.clear();
  for (const Part& run : of_group) part_of_group_.push_back(part_of_run(run));
  for (const Part& run : of_limited) part_of_limited_.push_back(std::max(0, part_of_run(run)));
  part_of_friction_.clear();
  for (const Part& run : of_friction) part_of_friction_.push_back(std::max(0, part_of_run(run)));
}

void MechanismDynamics::GroupJacobian(int g, Eigen::Ref<Matrix6X> J) const {
  const int index = PartOfGroup(g);
  if (index < 0) return;
  const ContactGroup& group = groups_[static_cast<std::size_t>(g)];
  const Part& part = parts_[static_cast<std::size_t>(index)];
  J.setZero();
  if (base_size_ > 0) J.leftCols<6>().setIdentity();
  // Reduced coordinates of the part.
  const int first = part.begin, count = part.size - base_size_;
  auto T = J.rightCols(count);
  if (options_.recovery == Recovery::kTwist) {
    const auto T_ref = model().T_of(group.body);
    T.noalias() = Dexp(T_ref * state_.reduced.z) * T_ref.middleCols(first, count);
    return;
  }
  if (group.last_joint < 0) {
    T.setZero();
    return;
  }
  T.middleCols(jacobian_.begin(group.last_joint) - first, jacobian_.size(group.last_joint)) =
      jacobian_.T(group.last_joint);
}

Vector6 MechanismDynamics::GroupTwist(int g, const Eigen::Ref<const MatrixX>& J_T) const {
  const int index = PartOfGroup(g);
  Vector6 V = Vector6::Zero();
  if (index >= 0) {
    const Part& part = parts_[static_cast<std::size_t>(index)];
    for (int k = 0; k < part.size; ++k) V += x_(part.begin + k) * J_T.row(k).transpose();
  }
  if (mechanism().base() == BaseKind::kDriven) V += state_.reduced.V_R;
  return V;
}

// From the last row to the first, as the factor goes: a foot then moves its own leg and the base, and no
// other leg.
void MechanismDynamics::HalfSolve(const Part& part, Eigen::Ref<MatrixX> Jt) const {
  const MatrixX& L = factor_.L();
  for (Eigen::Index c = 0; c < Jt.cols(); ++c) std::reverse(Jt.col(c).data(), Jt.col(c).data() + part.size);
  SolveLower(&L(part.begin, part.begin), part.size, static_cast<int>(L.rows()), Jt.data(),
             static_cast<int>(Jt.cols()), static_cast<int>(Jt.outerStride()));
}

}  // namespace fork1s
