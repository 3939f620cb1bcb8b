#include "load_columns.hpp"

namespace fork1s::internal {
namespace {

struct JointLoad {
  std::string name;
  VectorX force;  // n
  VectorX size;   // n: sum of |terms| of the force
};

VectorX JointForces(const Mechanism& mechanism, const Kinematics& kinematics, Matrix6X wrenches_R) {
  VectorX tau = VectorX::Zero(mechanism.num_coordinates());
  AccumulateGeneralizedForce(mechanism, kinematics.S, wrenches_R, tau);
  return tau;
}

VectorX WeightForces(const Mechanism& mechanism, const Kinematics& kinematics, const Vector3& gravity_R) {
  Matrix6X F = Matrix6X::Zero(6, mechanism.num_bodies());
  AddGravityWrenches(mechanism, kinematics, gravity_R, F);
  return JointForces(mechanism, kinematics, std::move(F));
}

JointLoad TotalLoad(const Mechanism& mechanism, const Kinematics& kinematics, const VectorX& q_ref,
                    const ReductionLoads& loads) {
  JointLoad total{"total load", VectorX(q_ref.size()), {}};
  SpringForce(mechanism, kinematics, q_ref, total.force);
  total.size = total.force.cwiseAbs();
  const auto add = [&](const VectorX& force) {
    total.force += force;
    total.size += force.cwiseAbs();
  };
  add(WeightForces(mechanism, kinematics, loads.gravity_R));
  if (loads.controls.size() > 0) {
    VectorX tau = VectorX::Zero(q_ref.size());
    AddControlForce(mechanism, kinematics, loads.controls, tau);
    add(tau);
  }
  if (loads.wrenches_R.size() > 0) add(JointForces(mechanism, kinematics, loads.wrenches_R));
  return total;
}

// Weight where the base is fixed; accelerations of a base that moves, and of free directions, else. Applied
// forces, reactions and controls that move by themselves, so that none of their static answer is missing
// however they come and go.
std::vector<JointLoad> LoadsOf(const Mechanism& mechanism, const Kinematics& kinematics, const VectorX& q_ref,
                               const ElasticBasis& basis, const ReductionLoads& loads,
                               const VectorX& reactions) {
  std::vector<JointLoad> all;
  const auto add = [&](std::string name, const VectorX& force) {
    all.push_back({std::move(name), force, force.cwiseAbs()});
  };
  const char axes[] = "xyz";
  if (!loads.gravity_R.isZero(0))
    for (int i = 0; i < 3; ++i)
      add(std::string("weight ") + axes[i], WeightForces(mechanism, kinematics, Vector3::Unit(i)));
  if (mechanism.base() != BaseKind::kFixed) {
    Matrix6 M_00;
    Matrix6X M_0q;
    BaseInertia(mechanism, kinematics, M_00, M_0q);
    for (int i = 0; i < 6; ++i)
      add(std::string(i < 3 ? "base turn " : "base motion ") + axes[i % 3], M_0q.row(i));
  }
  const MatrixX N = basis.DenseFree(mechanism.num_coordinates());
  VectorX MN;
  for (Eigen::Index i = 0; i < N.cols(); ++i) {
    ApplyMass(mechanism, kinematics, N.col(i), MN);
    add("free " + std::to_string(i + 1), MN);
  }
  if (loads.wrenches_R.size() > 0)
    add("applied forces", JointForces(mechanism, kinematics, loads.wrenches_R));
  if (reactions.size() > 0) add("reactions", reactions);
  for (Eigen::Index i = 0; i < loads.control_change.size(); ++i) {
    if (loads.control_change(i) == 0) continue;
    VectorX force = VectorX::Zero(mechanism.num_coordinates());
    AddControlForce(mechanism, kinematics, VectorX::Unit(loads.control_change.size(), i), force);
    add("control " + mechanism.controls()[static_cast<std::size_t>(i)].name, force);
  }
  all.push_back(TotalLoad(mechanism, kinematics, q_ref, loads));
  return all;
}

}  // namespace

LoadColumns ComputeLoadColumns(const Mechanism& mechanism, const Kinematics& kinematics, const VectorX& q_ref,
                               const ElasticBasis& basis, const MatrixX& kept, const ReductionLoads& loads,
                               const VectorX& reactions) {
  constexpr double kDropped = 1e-6;  // share of a load's answer that is new
  const Eigen::Index e = basis.num_elastic();
  LoadColumns columns;
  MatrixX span = kept;
  if (span.cols() == e) return columns;
  for (const JointLoad& load : LoadsOf(mechanism, kinematics, q_ref, basis, loads, reactions)) {
    const VectorX answer = basis.ApplyVTransposed(load.force);
    // Before anything cancels: what loops hold leaves rounding.
    const VectorX size = basis.ApplyAbsVTransposed(load.size);
    for (const ElasticBasis::Part& part : basis.parts) {
      VectorX y = VectorX::Zero(e);
      y.segment(part.elastic, part.num_elastic) = answer.segment(part.elastic, part.num_elastic);
      for (int pass = 0; pass < 2; ++pass) y -= span * (span.transpose() * y);
      if (!(y.norm() > kDropped * size.segment(part.elastic, part.num_elastic).norm())) continue;
      span.conservativeResize(e, span.cols() + 1);
      // Rounding of other parts is none of it.
      span.rightCols(1).setZero();
      span.rightCols(1).middleRows(part.elastic, part.num_elastic) =
          y.segment(part.elastic, part.num_elastic).normalized();
      Eigen::Index joint = 0;
      basis.ApplyV(span.rightCols(1), mechanism.num_coordinates()).cwiseAbs().maxCoeff(&joint);
      columns.names.push_back(load.name + " (" + mechanism.CoordinateName(static_cast<int>(joint)) + ")");
    }
  }
  columns.vectors = span.rightCols(span.cols() - kept.cols());
  return columns;
}

}  // namespace fork1s::internal
