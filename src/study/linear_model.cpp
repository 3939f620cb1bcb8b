#include "study/linear_model.hpp"

#include <algorithm>
#include <filesystem>
#include <fork1s/mechanism/kinematics.hpp>

#include "linalg/cholesky.hpp"
#include "linalg/products.hpp"
#include "record/array_file.hpp"

namespace fork1s {
namespace {

void AddSignal(std::string name, const char* unit, Signals& signals) {
  signals.names.push_back(std::move(name));
  signals.units.emplace_back(unit);
}

// Three angles or moments, then three lengths or forces.
void AddSixSignals(const std::string& body, const char* angular, const char* linear, Signals& signals) {
  constexpr const char* kNames[] = {".rx", ".ry", ".rz", ".x", ".y", ".z"};
  for (int i = 0; i < 6; ++i) AddSignal(body + kNames[i], i < 3 ? angular : linear, signals);
}

// Of a set-point that of the length which it sets; other inputs have that of the file (a motor's N m or N, the speed
// of a velocity servo, a voltage), which the definition does not tell.
const char* UnitOfControl(const Mechanism& m, std::size_t k) {
  if (!m.definition().controls[k].is_setpoint) return "unit of the actuator";
  return m.IsAngle(m.controls()[k].length) ? "rad" : "m";
}

// 6 x s: rotation and displacement of the body's origin per coordinate, world axes.
MatrixX BodyJacobianInWorld(const PosedMechanism& posed, const ReducedModel& model, BodyIndex body,
                            Eigen::Index size) {
  const Matrix3& R = posed.X_WR.rotation();
  const Vector3& p_R = model.X_RB_ref[body.u()].translation();
  const Eigen::Index r = model.size();
  MatrixX J = MatrixX::Zero(6, size);
  for (Eigen::Index k = 0; k < r; ++k) {
    Vector6 V = model.T.col(body.value() * r + k);
    V.tail<3>() += V.head<3>().cross(p_R);
    J.col(k) = InAxes(R, V);
  }
  if (size > r) {
    J.rightCols<6>().setIdentity();
    const Vector3 arm = R * p_R;
    for (int i = 0; i < 3; ++i) J.col(r + i).tail<3>() = Vector3::Unit(i).cross(arm);
  }
  return J;
}

void AddForceAtStart(const PosedMechanism& posed, const Kinematics& kinematics, const ReducedModel& model,
                     LinearModel& out) {
  const Mechanism& m = *posed.mechanism;
  Matrix6X F = Matrix6X::Zero(6, m.num_bodies());
  AddGravityWrenches(m, kinematics, posed.loads.gravity_R, F);
  VectorX tau;
  SpringForce(m, kinematics, model.q_ref, tau);
  AddControlForce(m, kinematics, posed.loads.controls, tau);
  AccumulateGeneralizedForce(m, kinematics.S, F, tau);
  out.f.head(model.size()) = TransposedTimes(model.Q, tau);
  // The column of the base has now the wrench on the whole.
  if (out.f.size() > model.size()) out.f.tail<6>() = InAxes(posed.X_WR.rotation(), F.col(0));
}

void AddInputs(const PosedMechanism& posed, const Kinematics& kinematics, const ReducedModel& model,
               LinearModel& out) {
  const Mechanism& m = *posed.mechanism;
  const auto controls = static_cast<Eigen::Index>(m.controls().size());
  out.B.setZero(out.M.rows(), controls + 6 * static_cast<Eigen::Index>(model.interfaces.size()));
  out.u_ref.setZero(out.B.cols());
  out.u_ref.head(controls) = posed.loads.controls;
  for (Eigen::Index k = 0; k < controls; ++k) {
    VectorX tau = VectorX::Zero(m.num_coordinates());
    AddControlForce(m, kinematics, VectorX::Unit(controls, k), tau);
    out.B.col(k).head(model.size()) = TransposedTimes(model.Q, tau);
    AddSignal(m.controls()[static_cast<std::size_t>(k)].name, UnitOfControl(m, static_cast<std::size_t>(k)),
              out.inputs);
  }
  // The power of a wrench is that on the body's motion: its columns are the rows of C.
  const Eigen::Index wrenches = out.B.cols() - controls;
  out.B.rightCols(wrenches) = out.C.topRows(wrenches).transpose();
  for (const std::string& body : out.interfaces) AddSixSignals(body, "N m", "N", out.inputs);
}

NamedArray Texts(const char* name, const std::vector<std::string>& texts) { return {name, texts}; }

void AddSignalArrays(const std::string& of, const Signals& signals, std::vector<NamedArray>& arrays) {
  arrays.push_back({of + "_names", signals.names});
  arrays.push_back({of + "_units", signals.units});
}

NumberArray PoseArray(const std::vector<RigidTransform>& poses) {
  NumberArray out{{poses.size(), 4, 4}, {}};
  for (const RigidTransform& X : poses) {
    for (int i = 0; i < 3; ++i) {
      for (int k = 0; k < 3; ++k) out.values.push_back(X.rotation()(i, k));
      out.values.push_back(X.translation()(i));
    }
    out.values.insert(out.values.end(), {0, 0, 0, 1});
  }
  return out;
}

}  // namespace

LinearModel ComputeLinearModel(const PosedMechanism& posed, const ReducedModel& model) {
  const Mechanism& m = *posed.mechanism;
  const Eigen::Index r = model.size(), n = m.num_coordinates(),
                     base = m.base() == BaseKind::kFloating ? 6 : 0, s = r + base,
                     of_bodies = 6 * static_cast<Eigen::Index>(model.interfaces.size());
  Kinematics kinematics(m);
  ComputeKinematics(m, model.q_ref, kinematics);
  LinearModel out;
  out.mechanism = m.name();
  out.M.setZero(s, s);
  out.D.setZero(s, s);
  out.K.setZero(s, s);
  out.f.setZero(s);
  out.M.topLeftCorner(r, r) = model.M;
  out.D.topLeftCorner(r, r) = model.D;
  out.K.diagonal().head(r) = model.K_r;
  for (const std::string& name : model.column_names) AddSignal(name, "1", out.coordinates);
  if (base > 0) {
    MatrixX R = MatrixX::Zero(6, 6);
    R.topLeftCorner<3, 3>() = R.bottomRightCorner<3, 3>() = posed.X_WR.rotation();
    out.M.bottomRightCorner(6, 6) = Congruence(model.M_00, R.transpose());
    out.M.bottomLeftCorner(6, r) = Times(R, model.M_0z);
    out.M.topRightCorner(r, 6) = out.M.bottomLeftCorner(6, r).transpose();
    AddSixSignals(m.body(BodyIndex(0)).name, "rad", "m", out.coordinates);
  }
  AddForceAtStart(posed, kinematics, model, out);

  out.C.setZero(of_bodies + n, s);
  for (std::size_t i = 0; i < model.interfaces.size(); ++i) {
    const BodyIndex body = model.interfaces[i];
    out.C.middleRows(6 * static_cast<Eigen::Index>(i), 6) = BodyJacobianInWorld(posed, model, body, s);
    out.interfaces.push_back(m.body(body).name);
    out.X_WB_ref.push_back(posed.X_WR * model.X_RB_ref[body.u()]);
    AddSixSignals(out.interfaces.back(), "rad", "m", out.outputs);
  }
  out.C.block(of_bodies, 0, n, r) = model.Q;
  out.q_ref = model.q_ref;
  for (int i = 0; i < m.num_coordinates(); ++i) {
    AddSignal(m.CoordinateName(i), m.Turns(i) ? "rad" : "m", out.joints);
    AddSignal(m.CoordinateName(i), m.Turns(i) ? "rad" : "m", out.outputs);
  }
  AddInputs(posed, kinematics, model, out);
  return out;
}

Expected<StateSpace> ToStateSpace(const LinearModel& model) {
  const Eigen::Index s = model.M.rows(), m = model.B.cols();
  Cholesky inertia;
  if (!inertia.Compute(model.M))
    return Fail(
        ErrorCode::kNumerics, "mechanism '" + model.mechanism + "'",
        "has a motion without inertia, so that its acceleration is not determined; give the parts that move "
        "mass, or their joints armature");
  MatrixX accelerations(s, 2 * s + m + 1);
  accelerations << -model.K, -model.D, model.B, model.f;
  inertia.SolveInPlace(accelerations);
  StateSpace out;
  out.A.setZero(2 * s, 2 * s);
  out.A.topRightCorner(s, s).setIdentity();
  out.A.bottomRows(s) = accelerations.leftCols(2 * s);
  out.B.setZero(2 * s, m);
  out.B.bottomRows(s) = accelerations.middleCols(2 * s, m);
  out.c.setZero(2 * s);
  out.c.tail(s) = accelerations.col(2 * s + m);
  out.C.setZero(model.C.rows(), 2 * s);
  out.C.leftCols(s) = model.C;
  out.D.setZero(model.C.rows(), m);
  out.states = model.coordinates;
  for (std::size_t i = 0; i < model.coordinates.names.size(); ++i) {
    out.states.names.push_back("rate of " + model.coordinates.names[i]);
    out.states.units.push_back(model.coordinates.units[i] + "/s");
  }
  out.inputs = model.inputs;
  out.outputs = model.outputs;
  return out;
}

Expected<void> SaveLinearModel(const LinearModel& model, const std::string& path) {
  std::vector<NamedArray> arrays = {
      {"M", ToNumberArray(model.M)},           {"D", ToNumberArray(model.D)},
      {"K", ToNumberArray(model.K)},           {"B", ToNumberArray(model.B)},
      {"C", ToNumberArray(model.C)},           {"f", ToNumberArray(model.f)},
      {"u_ref", ToNumberArray(model.u_ref)},   {"q_ref", ToNumberArray(model.q_ref)},
      {"X_WB_ref", PoseArray(model.X_WB_ref)}, Texts("mechanism", {model.mechanism}),
      Texts("interfaces", model.interfaces)};
  AddSignalArrays("coordinate", model.coordinates, arrays);
  AddSignalArrays("input", model.inputs, arrays);
  AddSignalArrays("output", model.outputs, arrays);
  AddSignalArrays("joint", model.joints, arrays);
  return std::filesystem::path(path).extension() == ".mat" ? SaveMatFile(arrays, path)
                                                           : SaveNpzFile(arrays, path);
}

}  // namespace fork1s
