#include "mujoco_model.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "linalg/cholesky.hpp"
#include "linalg/null_space.hpp"
#include "linalg/products.hpp"
#include "linalg/solve.hpp"
#include "linalg/spectrum.hpp"
#include "study/mujoco_handles.hpp"

namespace fork1s::internal {
namespace {

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

}  // namespace

struct MuJoCoModel::Detail {
  MuJoCoModelPointer model;
  MuJoCoDataPointer data;
  std::vector<int> joints;  // velocities that are not of a free joint: those that move while the base is held

  // Positions, inertia and constraints at qpos, at rest.
  void Forward() const {
    std::fill_n(data->qvel, model->nv, 0.);
    mj_fwdPosition(model.get(), data.get());
    mj_fwdVelocity(model.get(), data.get());
  }
  void Reset() const {
    mj_resetData(model.get(), data.get());
    Forward();
  }
  VectorX Stiffness() const {
    VectorX k = VectorX::Zero(model->nv);
    for (int j = 0; j < model->njnt; ++j) {
      const int size = model->jnt_type[j] == mjJNT_BALL ? 3 : model->jnt_type[j] == mjJNT_FREE ? 6 : 1;
      k.segment(model->jnt_dofadr[j], size).setConstant(model->jnt_stiffness[j]);
    }
    return k;
  }
  // Rows of the equality constraints; they come first, and these models have no others.
  MatrixX EqualityJacobian() const {
    const Eigen::Index rows = data->ne, nv = model->nv;
    // Row by row, since MuJoCo keeps large ones sparse.
    RowMajor A(rows, nv);
    VectorX row = VectorX::Zero(data->nefc);
    for (int i = 0; i < rows; ++i) {
      row(i) = 1;
      mj_mulJacTVec(model.get(), data.get(), A.data() + static_cast<std::ptrdiff_t>(i) * nv, row.data());
      row(i) = 0;
    }
    return A;
  }
  VectorX EqualityResidual() const { return Eigen::Map<const VectorX>(data->efc_pos, data->ne); }
  MatrixX BodyJacobian(int body) const {
    RowMajor rotation(3, model->nv), translation(3, model->nv);
    mj_jacBody(model.get(), data.get(), translation.data(), rotation.data(), body);
    MatrixX J(6, model->nv);
    J << rotation, translation;
    return J;
  }
  MatrixX Columns(const MatrixX& A) const {
    MatrixX out(A.rows(), static_cast<Eigen::Index>(joints.size()));
    for (std::size_t i = 0; i < joints.size(); ++i) out.col(static_cast<Eigen::Index>(i)) = A.col(joints[i]);
    return out;
  }
  int Body(const std::string& name) const { return mj_name2id(model.get(), mjOBJ_BODY, name.c_str()); }
};

namespace {

// Orthonormal basis of the motions that A x = 0 leaves.
MatrixX Kernel(const MatrixX& A, Eigen::Index columns) {
  if (A.rows() == 0) return MatrixX::Identity(columns, columns);
  return ComputeNullSpace(A).unseen;
}

}  // namespace

MuJoCoModel::MuJoCoModel() : detail_(std::make_unique<Detail>()) {}
MuJoCoModel::~MuJoCoModel() = default;
MuJoCoModel::MuJoCoModel(MuJoCoModel&&) noexcept = default;

Expected<MuJoCoModel> MuJoCoModel::Load(const std::string& path) {
  char message[1000] = "";
  MuJoCoModel out;
  Detail& d = *out.detail_;
  d.model.reset(mj_loadXML(path.c_str(), nullptr, message, static_cast<int>(sizeof message)));
  if (!d.model) return Fail(ErrorCode::kFormat, path, std::string("MuJoCo refuses it: ") + message);
  d.data.reset(mj_makeData(d.model.get()));
  for (int i = 0; i < d.model->nv; ++i)
    if (d.model->jnt_type[d.model->dof_jntid[i]] != mjJNT_FREE) d.joints.push_back(i);
  d.Reset();
  return out;
}

int MuJoCoModel::JointVelocity(const std::string& joint) const {
  const int j = mj_name2id(detail_->model.get(), mjOBJ_JOINT, joint.c_str());
  return j < 0 ? -1 : detail_->model->jnt_dofadr[j];
}

MatrixX MuJoCoModel::MassMatrix() const {
  detail_->Reset();
  RowMajor M(detail_->model->nv, detail_->model->nv);
  mj_fullM(detail_->model.get(), detail_->data.get(), M.data());
  return M;
}

std::vector<double> MuJoCoModel::Frequencies(int count) const {
  const MatrixX M = MassMatrix(), Z = Kernel(detail_->EqualityJacobian(), detail_->model->nv);
  const MatrixX K = DiagonalCongruence(detail_->Stiffness(), Z);
  const VectorX squares = EigenvaluesOf(K, Congruence(M, Z));
  std::vector<double> hertz;
  for (const double w : squares)
    if (w > 1e-9 * squares.maxCoeff() && static_cast<int>(hertz.size()) < count)
      hertz.push_back(std::sqrt(w) / (2 * std::numbers::pi));
  return hertz;
}

MatrixX MuJoCoModel::Compliance(const std::vector<std::string>& bodies) const {
  const Detail& d = *detail_;
  d.Reset();
  const auto n = static_cast<Eigen::Index>(d.joints.size());
  const MatrixX Z = Kernel(d.Columns(d.EqualityJacobian()), n);
  const VectorX k = d.Columns(d.Stiffness().transpose()).transpose();
  MatrixX J(static_cast<Eigen::Index>(6 * bodies.size()), n);
  for (std::size_t i = 0; i < bodies.size(); ++i)
    J.middleRows<6>(static_cast<Eigen::Index>(6 * i)) = d.Columns(d.BodyJacobian(d.Body(bodies[i])));
  const MatrixX JZ = Times(J, Z), K = DiagonalCongruence(k, Z);
  return JZ * SolveSymmetric(K, JZ.transpose());
}

Expected<std::vector<RigidTransform>> MuJoCoModel::Rest(const RestLoad& load,
                                                        const std::vector<std::string>& bodies) const {
  constexpr int kLoadSteps = 8, kIterations = 40;
  constexpr double kRepeated = 1e-12;  // pivots of rows that repeat others, beside the largest
  // Central differences of forces: 1e-5 rad leaves 1e-10 of the tangent, so that Newton still converges fast.
  constexpr double kForceDifference = 1e-5;
  const Detail& d = *detail_;
  mjModel* m = d.model.get();
  mjData* data = d.data.get();
  const auto n = static_cast<Eigen::Index>(d.joints.size());
  d.Reset();
  const Eigen::Index rows = data->ne;
  std::vector<double> qpos(data->qpos, data->qpos + m->nq);
  VectorX lambda = VectorX::Zero(rows);
  double share = 0;
  auto move = [&](const VectorX& by) {
    VectorX step = VectorX::Zero(m->nv);
    for (Eigen::Index i = 0; i < n; ++i) step(d.joints[static_cast<std::size_t>(i)]) = by(i);
    std::copy_n(qpos.data(), m->nq, data->qpos);
    mj_integratePos(m, data->qpos, step.data(), 1);
    d.Forward();
  };
  // Springs, gravity, load and reactions at the pose of `data`.
  auto force = [&] {
    VectorX f = Eigen::Map<VectorX>(data->qfrc_passive, m->nv) - Eigen::Map<VectorX>(data->qfrc_bias, m->nv);
    if (load.body)
      f += d.BodyJacobian(d.Body(*load.body)).bottomRows<3>().transpose() * (share * load.force_W);
    f += d.EqualityJacobian().transpose() * lambda;
    return VectorX(d.Columns(f.transpose()).transpose());
  };
  for (int s = 1; s <= kLoadSteps; ++s) {
    share = static_cast<double>(s) / kLoadSteps;
    for (int i = 0; i < 3; ++i) m->opt.gravity[i] = share * load.gravity_W(i);
    bool converged = false;
    for (int iteration = 0; iteration < kIterations && !converged; ++iteration) {
      move(VectorX::Zero(n));
      VectorX right(n + rows);
      right << force(), -d.EqualityResidual();
      MatrixX K = MatrixX::Zero(n + rows, n + rows);
      const MatrixX A = d.Columns(d.EqualityJacobian());
      K.topRightCorner(n, rows) = -A.transpose();
      K.bottomLeftCorner(rows, n) = A;
      for (Eigen::Index i = 0; i < n; ++i) {
        move(kForceDifference * VectorX::Unit(n, i));
        const VectorX ahead = force();
        move(-kForceDifference * VectorX::Unit(n, i));
        K.col(i).head(n) = (force() - ahead) / (2 * kForceDifference);
      }
      // Rows that repeat others share their reactions.
      const VectorX x =
          rows == 0 ? VectorX(SolveSquare(K, right)) : VectorX(LeastNormSolve(K, right, kRepeated));
      move(x.head(n));
      std::copy(data->qpos, data->qpos + m->nq, qpos.begin());
      lambda += x.tail(rows);
      converged = x.head(n).cwiseAbs().maxCoeff() < 1e-11;
      if (!x.allFinite()) break;
    }
    if (!converged) {
      mju_zero3(m->opt.gravity);
      return Fail(ErrorCode::kNumerics, "MuJoCo", "Newton on its forces did not converge");
    }
  }
  move(VectorX::Zero(n));
  mju_zero3(m->opt.gravity);
  std::vector<RigidTransform> poses;
  for (const std::string& body : bodies) poses.push_back(PoseOf(data, d.Body(body)));
  return poses;
}

}  // namespace fork1s::internal
