// What contacts see of a mechanism: parts that move independently, the twists of its contact groups.
#include <algorithm>
#include <fork1s/base/quad.hpp>

#include "linalg/in_place.hpp"
#include "mechanism_detail.hpp"

namespace fork1s {

// Parts are runs of velocities: what a finger on a held palm moves by stands together.
void FindDecoupledBlocks(MechanismModel& model) {
  const int r = model.size(), nx = model.num_velocities();
  const ReducedJacobian jacobian(*model.reduced);  // which columns move a joint
  std::vector<int> reach(static_cast<std::size_t>(std::max(nx, 1)));
  for (std::size_t i = 0; i < reach.size(); ++i) reach[i] = static_cast<int>(i);
  auto join = [&](int first, int last) {
    if (first <= last)
      reach[static_cast<std::size_t>(first)] = std::max(reach[static_cast<std::size_t>(first)], last);
  };
  // Columns that move a joint at any pose.
  const auto of_joint = [&](int joint) {
    return joint < 0 ? VelocityRange{} : VelocityRange{jacobian.begin(joint), jacobian.size(joint)};
  };
  const auto of_length = [&](const Mechanism::Length& length) {
    int first = r, last = -1;
    for (const int i : model.mechanism().CoordinatesOf(length)) {
      const VelocityRange run = of_joint(model.mechanism().CoordinateJoint(i).value());
      if (run.size == 0) continue;
      first = std::min(first, run.begin);
      last = std::max(last, run.begin + run.size - 1);
    }
    return last < 0 ? VelocityRange{} : VelocityRange{first, last + 1 - first};
  };
  std::vector<VelocityRange> of_group, of_limited, of_friction, of_bounded;
  for (const ContactGroup& g : model.groups) of_group.push_back(of_joint(g.last_joint));
  for (const auto& l : model.mechanism().length_limits()) of_limited.push_back(of_length(l.length));
  for (const auto& f : model.mechanism().frictions()) of_friction.push_back(of_length(f.length));
  for (const auto& f : model.mechanism().force_limits()) of_bounded.push_back(of_length(f.length));
  for (const auto& s : model.mechanism().springs())
    if (s.slack > 0) of_bounded.insert(of_bounded.end(), 2, of_length(s.length));
  if (model.base_size > 0) {
    join(0, nx - 1);
  } else {
    const auto join_run = [&](const VelocityRange& run) { join(run.begin, run.begin + run.size - 1); };
    for (int j = 0; j < model.mechanism().num_joints(); ++j) join_run(of_joint(j));
    for (int i = 0; i < r; ++i)
      for (int j = r - 1; j > i; --j)
        if (model.reduced->D(i, j) != 0) {
          join(i, j);
          break;
        }
    for (const auto* runs : {&of_limited, &of_friction, &of_bounded})
      for (const VelocityRange& run : *runs) join_run(run);
    // Springs of paths turn in A as the pose does, and those that are not linear stiffen.
    for (const auto& s : model.mechanism().springs())
      if (s.length.path >= 0 || !s.is_linear()) join_run(of_length(s.length));
  }
  model.parts.clear();
  std::vector<int> part_of(static_cast<std::size_t>(nx), 0);
  for (int i = 0; i < nx;) {
    int last = reach[static_cast<std::size_t>(i)];
    for (int j = i; j <= last; ++j) last = std::max(last, reach[static_cast<std::size_t>(j)]);
    for (int j = i; j <= last; ++j)
      part_of[static_cast<std::size_t>(j)] = static_cast<int>(model.parts.size());
    model.parts.push_back({i, last + 1 - i});
    i = last + 1;
  }
  auto part_of_run = [&](const VelocityRange& run) {
    if (model.base_size > 0) return 0;
    return run.size == 0 ? -1 : part_of[static_cast<std::size_t>(run.begin)];
  };
  model.part_of_group.clear();
  model.part_of_limited.clear();
  for (const VelocityRange& run : of_group) model.part_of_group.push_back(part_of_run(run));
  for (const VelocityRange& run : of_limited) model.part_of_limited.push_back(std::max(0, part_of_run(run)));
  model.part_of_friction.clear();
  for (const VelocityRange& run : of_friction)
    model.part_of_friction.push_back(std::max(0, part_of_run(run)));
  model.part_of_bounded_force.clear();
  for (const VelocityRange& run : of_bounded)
    model.part_of_bounded_force.push_back(run.size == 0 ? -1 : part_of_run(run));
}

void DivideIntoParts(const StepContext& ctx) {
  const auto& [model, state, ws] = ctx;
  std::vector<DiagonalBlock> blocks;
  for (const VelocityRange& part : model.parts) blocks.push_back({part.begin, part.size});
  ws.mass.factor = Cholesky();
  ws.mass.factor.Divide(blocks, true);
  ws.matrix.factor.Divide(std::move(blocks), true);
}

void GroupJacobian(const ConstStepContext& ctx, int g, Eigen::Ref<MatrixX> J_T) {
  const auto& [model, state, ws] = ctx;
  const int index = model.PartOfGroup(g);
  if (index < 0) return;
  const ContactGroup& group = model.groups[static_cast<std::size_t>(g)];
  const VelocityRange& part = model.parts[static_cast<std::size_t>(index)];
  J_T.setZero();
  if (model.base_size > 0) J_T.topRows<6>().setIdentity();
  // Reduced coordinates of the part.
  const int first = part.begin;
  if (ws.expansion.in_use) {
    J_T = ws.expansion.pose.J[static_cast<std::size_t>(g)].middleCols(first, part.size).transpose();
  } else if (const int j = group.last_joint; j >= 0) {
    // Rows of T are columns here: both stand one number behind the other.
    const auto T = ws.jacobian.T(j);
    const Eigen::Index to = model.base_size + ws.jacobian.begin(j) - first;
    for (Eigen::Index c = 0; c < 6; ++c) std::copy_n(T.data() + c * T.outerStride(), T.cols(), &J_T(to, c));
  }
}

namespace {

Vector6 TwistOfGroup(const ConstStepContext& ctx, int g, const Eigen::Ref<const MatrixX>& J_T,
                     const VectorX& velocity) {
  const auto& [model, state, ws] = ctx;
  const int index = model.PartOfGroup(g);
  Vector6 V = Vector6::Zero();
  if (index >= 0) {
    const VelocityRange& part = model.parts[static_cast<std::size_t>(index)];
    // All six columns at once, so that x is read once.
    const double *x = velocity.data() + part.begin, *J = J_T.data();
    const std::ptrdiff_t stride = J_T.outerStride();
    Quad sums[6];
    for (Quad& sum : sums) sum.setZero();
    int k = 0;
    for (; k + 4 <= part.size; k += 4)
      for (int c = 0; c < 6; ++c) sums[c] += QuadAt(J + c * stride + k).cwiseProduct(QuadAt(x + k));
    for (int c = 0; c < 6; ++c) V[c] = sums[c].sum();
    for (; k < part.size; ++k)
      for (int c = 0; c < 6; ++c) V[c] += J[c * stride + k] * x[k];
  }
  if (model.mechanism().base() == BaseKind::kDriven) V += state.reduced.V_R;
  return V;
}

}  // namespace

Vector6 GroupTwist(const ConstStepContext& ctx, int g, const Eigen::Ref<const MatrixX>& J_T) {
  return TwistOfGroup(ctx, g, J_T, ctx.work.x);
}

Vector6 GroupTwistAtStart(const ConstStepContext& ctx, int g, const Eigen::Ref<const MatrixX>& J_T) {
  return TwistOfGroup(ctx, g, J_T, ctx.work.stage_start.x);
}

// From the last row to the first, as the factor goes: a foot then moves its own leg and the base, and no
// other leg.
void HalfSolve(const ConstStepContext& ctx, const VelocityRange& part, Eigen::Ref<MatrixX> Jt) {
  const auto& [model, state, ws] = ctx;
  const MatrixX& L = ws.matrix.factor.L();
  for (Eigen::Index c = 0; c < Jt.cols(); ++c) std::reverse(Jt.col(c).data(), Jt.col(c).data() + part.size);
  SolveLower(&L(part.begin, part.begin), part.size, static_cast<int>(L.rows()), Jt.data(),
             static_cast<int>(Jt.cols()), static_cast<int>(Jt.outerStride()));
}

}  // namespace fork1s
