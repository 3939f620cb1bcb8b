// Dampers of joints, of rotations and along lengths: at the reference in D of the model, at the pose at hand
// beyond it.
#include <algorithm>

#include "forces.hpp"
#include "linalg/row_squares.hpp"

namespace fork1s {
namespace {

// A row that these columns move joins the group of all that they move.
void AddWeightedRow(const ReducedModel::Run& run, int row, double weight, std::vector<WeightedRows>& groups) {
  auto at = std::find_if(groups.begin(), groups.end(), [&](const WeightedRows& rows) {
    return rows.begin == run.begin && rows.size == run.size;
  });
  if (at == groups.end()) at = groups.insert(at, {run.begin, run.size, {}, {}});
  at->rows.push_back(row);
  at->weights.push_back(weight);
}

// Coordinates with a weight above 0, by the columns that move them.
std::vector<WeightedRows> RowsByColumns(const ReducedModel& model, const VectorX& weights) {
  std::vector<WeightedRows> out;
  for (int i = 0; i < weights.size(); ++i)
    if (weights(i) > 0) AddWeightedRow(model.runs[static_cast<std::size_t>(i)], i, weights(i), out);
  return out;
}

// Columns that move any coordinate of a rotation.
ReducedModel::Run RunOf(const ReducedModel& model, const Mechanism::Rotation& rotation) {
  int begin = model.size(), end = 0;
  for (const int i : rotation.coordinates) {
    const ReducedModel::Run run = model.runs[static_cast<std::size_t>(i)];
    if (run.size == 0) continue;
    begin = std::min(begin, run.begin);
    end = std::max(end, run.begin + run.size);
  }
  return end > begin ? ReducedModel::Run{begin, end - begin} : ReducedModel::Run{};
}

}  // namespace

void FindDampers(MechanismModel& model) {
  const Mechanism& m = model.mechanism();
  VectorX damping = m.damping();
  model.at_reference.damped_rotations.clear();
  model.at_reference.rotation_dampers.clear();
  for (std::size_t k = 0; k < m.rotations().size(); ++k) {
    const Mechanism::Rotation& rotation = m.rotations()[k];
    const auto& [a, b, c] = rotation.coordinates;
    if (!(damping(a) + damping(b) + damping(c) > 0)) continue;
    int row = 3 * static_cast<int>(model.at_reference.damped_rotations.size());
    model.at_reference.damped_rotations.push_back(static_cast<int>(k));
    for (const int i : rotation.coordinates) {
      AddWeightedRow(RunOf(*model.reduced, rotation), row++, damping(i), model.at_reference.rotation_dampers);
      damping(i) = 0;
    }
  }
  model.at_reference.dampers = RowsByColumns(*model.reduced, damping);
  VectorX stiffness = m.stiffness();
  for (const Mechanism::ForceLimit& limit : m.force_limits())  // UpdateServoOperator has these
    if (limit.length.path < 0 && limit.length.terms.size() == 1) {
      const auto& [i, c] = limit.length.terms.front();
      stiffness(i) = std::max(0.0, stiffness(i) - c * c * limit.stiffness);
    }
  model.at_reference.joint_springs = RowsByColumns(*model.reduced, stiffness);
  model.at_reference.joint_damping.setZero(model.size(), model.size());
  for (const WeightedRows& rows : model.at_reference.dampers)
    AddRowSquares(model.reduced->Q_rows, rows, 1, model.at_reference.joint_damping);
  model.at_reference.rotation_damping.setZero(model.size(), model.size());
  Kinematics kinematics(model.mechanism());
  ComputeKinematics(model.mechanism(), model.reduced->q_ref, kinematics);
  if (!model.at_reference.damped_rotations.empty()) {
    RowMatrixX rows;
    AddRotationDamping(model, kinematics, model.reduced->Q_rows, 1, rows,
                       model.at_reference.rotation_damping);
  }
  const auto damps = [](const ClosureDef& c) {
    return !c.rigid.select(Vector6::Zero(), c.damping).isZero(0);
  };
  model.at_reference.closure_damping.resize(0, 0);
  if (std::none_of(m.closures().begin(), m.closures().end(), damps)) return;
  model.at_reference.closure_damping =
      model.reduced->D - model.at_reference.joint_damping - model.at_reference.rotation_damping;
  VectorX row(model.size());
  for (const Mechanism::Spring& s : m.springs()) {
    ReducedRow(s.length, kinematics.paths, model.reduced->Q_rows, row);
    model.at_reference.closure_damping -= s.DampingAt(0) * row * row.transpose();
  }
}

void AddSpringDampers(const StepContext& ctx, double b, const VectorX& q_dot, VectorX& tau) {
  for (const Mechanism::Spring& s : ctx.model.mechanism().springs()) {
    double rate = 0;
    ForEachArm(s.length, ctx.work.paths(), [&](int i, double c) { rate += c * q_dot(i); });
    if (const double damping = s.DampingAt(rate); damping > 0)
      AddLengthForce(ctx, s.length, -b * damping * rate, tau);
  }
}

void AddRotationDamping(const MechanismModel& model, const Kinematics& kinematics, const RowMatrixX& Q,
                        double weight, RowMatrixX& rows, Eigen::Ref<MatrixX> D) {
  const Mechanism& m = model.mechanism();
  rows.resize(3 * static_cast<Eigen::Index>(model.at_reference.damped_rotations.size()), Q.cols());
  Eigen::Index row = 0;
  for (const int k : model.at_reference.damped_rotations) {
    const Mechanism::Rotation& rotation = m.rotations()[static_cast<std::size_t>(k)];
    const Matrix3 E = AngularVelocityMap(m, kinematics, rotation);
    const auto& [a, b, c] = rotation.coordinates;
    for (int i = 0; i < 3; ++i)
      rows.row(row++) = E(i, 0) * Q.row(a) + E(i, 1) * Q.row(b) + E(i, 2) * Q.row(c);
  }
  for (const WeightedRows& group : model.at_reference.rotation_dampers) AddRowSquares(rows, group, weight, D);
}

// Loops turn Q as the pose moves, and with it what dampers of joints and of straight tendons are in reduced
// coordinates. Springs too, but their forces are those of the pose wherever A has its stiffness; a damper acts through
// A alone. Springy closures keep the damping of the reference.
// Dampers of rotations change with E.
bool DamperOperatorDependsOnPose(const MechanismModel& model) {
  return model.reduced->loop_rank() > 0 || !model.at_reference.damped_rotations.empty();
}

void AddDamperChange(const StepContext& ctx, double weight, bool bent, const VectorX& w,
                     Eigen::Ref<MatrixX> D) {
  const auto& [model, state, ws] = ctx;
  const Mechanism& m = model.mechanism();
  const bool turn = model.reduced->loop_rank() > 0;
  if (!model.at_reference.damped_rotations.empty()) {
    D -= weight * model.at_reference.rotation_damping;
    AddRotationDamping(model, ws.configuration.kinematics, ws.Q_now(), weight, ws.scratch.rotation_rows, D);
  }
  if (turn) {
    D -= weight * model.at_reference.joint_damping;
    for (const WeightedRows& rows : model.at_reference.dampers) AddRowSquares(ws.Q_now(), rows, weight, D);
  }
  for (const Mechanism::Spring& s : m.springs()) {
    const bool bends = s.length.path >= 0 || !s.is_linear();
    if (bends ? !bent : !turn || s.damping == 0) continue;
    ReducedRow(s.length, ws.paths(), ws.Q_now(), ws.scratch.length_row);
    D.noalias() += weight * s.DampingAt(ws.scratch.length_row.dot(w)) * ws.scratch.length_row *
                   ws.scratch.length_row.transpose();
    ReducedRow(s.length, model.at_reference.paths, model.reduced->Q_rows, ws.scratch.length_row);
    D.noalias() -= weight * s.DampingAt(0) * ws.scratch.length_row * ws.scratch.length_row.transpose();
  }
}

}  // namespace fork1s
