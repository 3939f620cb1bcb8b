// The walk: compliance by adding joints along paths, conditioned by loops (docs/method.md, section 3).
//
// Under interface loads f, loop reactions λ and motions a of unsprung joints, with W the loops' rows on the
// joints (rigid ones, tendons, springy directions of softness C_l),
//     q_s = K⁻¹ (J_sᵀ f − W_sᵀ λ),      J_uᵀ f = W_uᵀ λ,      W_s q_s + W_u a = C_l λ,      d = J_s q_s + J_u a.
// Motions a with W_u a = 0 are free: no spring, no loop sees them. For loads that do no work on them
// λ = (W_uᵀ)⁺J_uᵀ f + Y η, Y a basis of null(W_uᵀ), and η makes the elastic energy least:
//     G = [K^-½ J_sᵀ; 0] − E (W_uᵀ)⁺ J_uᵀ,   E = [K^-½ W_sᵀ; C_l^½],   C = Gᵀ (1 − Π) G,
// Π the projector on the range of E Y. Joints in no loop stand apart: their terms of Gᵀ G are the sum over
// shared paths. Nothing is subtracted but what Π takes, so that no compliance is left over as a difference of
// large ones. Which loops are redundant is decided on E Y without its springs: by geometry alone.
#include <algorithm>
#include <cmath>
#include <fork1s/reduction/compliance.hpp>

#include "elastic_basis.hpp"
#include "free_motions.hpp"
#include "linalg/null_space.hpp"
#include "linalg/products.hpp"
#include "linalg/select.hpp"
#include "linalg/solve.hpp"

namespace fork1s {
namespace {

// Rows of everything that ties joints together, in one unit: rigid closures and couplings first (softness 0),
// then tendons and springy directions.
struct Loops {
  MatrixX W;         // m x n
  VectorX softness;  // m, in the rows' own unit
  int rigid = 0;     // rows
};

Loops CollectLoops(const Mechanism& mechanism, const Kinematics& kinematics, const VectorX& q,
                   const CoordinateScaling& unit) {
  const MatrixX rigid = ScaledClosureRows(mechanism, kinematics, q, unit);
  const SpringRows springs = ScaledSpringRows(mechanism, kinematics, q, unit);
  std::vector<int> soft;
  for (std::size_t i = 0; i < springs.joint.size(); ++i)
    if (springs.joint[i] < 0) soft.push_back(static_cast<int>(i));
  Loops loops;
  loops.rigid = static_cast<int>(rigid.rows());
  loops.W.resize(rigid.rows() + static_cast<Eigen::Index>(soft.size()), mechanism.num_coordinates());
  loops.W << rigid, Rows(springs.rows, soft);
  loops.softness = VectorX::Zero(loops.W.rows());
  loops.softness.tail(static_cast<Eigen::Index>(soft.size())) =
      Entries(springs.weight, soft).cwiseAbs2().cwiseInverse();
  return loops;
}

// Columns of joints that take part in loops, or have no spring of their own, and those of plain paths. Locked
// coordinates do not move and are in none of them.
struct Parts {
  std::vector<int> path, looped, unsprung;  // coordinates; the first two are sprung
};

Parts Divide(const Mechanism& mechanism, const MatrixX& W, const std::vector<int>& locked) {
  Parts parts;
  for (int i = 0; i < mechanism.num_coordinates(); ++i) {
    if (std::find(locked.begin(), locked.end(), i) != locked.end()) continue;
    if (!(mechanism.stiffness()(i) > 0))
      parts.unsprung.push_back(i);
    else if (W.rows() > 0 && !W.col(i).isZero(0))
      parts.looped.push_back(i);
    else
      parts.path.push_back(i);
  }
  return parts;
}

// What loops leave of the looped joints' and closures' motions: the columns of (1 − Π) G as rows of interface
// displacement, 6e x (looped + soft). `flexibility` holds K^-½ of the looped joints and C_l^½ of the soft
// rows; ones give the same motions without springs.
class LoopedJoints {
 public:
  LoopedJoints(const Loops& loops, const Parts& parts, const MatrixX& J_x)
      : J_s_(Columns(J_x, parts.looped)), J_u_(Columns(J_x, parts.unsprung)) {
    const Eigen::Index m = loops.W.rows(), soft = m - loops.rigid;
    E_ = MatrixX::Zero(J_s_.cols() + soft, m);
    E_.topRows(J_s_.cols()) = Columns(loops.W, parts.looped).transpose();
    E_.bottomRightCorner(soft, soft).setIdentity();
    const MatrixX W_u = Columns(loops.W, parts.unsprung);
    unsprung_ = ComputeNullSpace(W_u);
    // (W_uᵀ)⁺ = U (Uᵀ W_u seen)^-ᵀ seenᵀ, U the range of W_u
    const MatrixX held = Times(W_u, unsprung_.seen);
    const MatrixX U = GradedRangeBasis(held);
    particular_ = Times(U, SolveSquare(TransposedTimes(held, U), Times(J_u_, unsprung_.seen).transpose()));
    const MatrixX Y = OrthogonalComplement(U);
    felt_ = Times(E_, Y);
    independent_ = ComputeNullSpace(felt_);
    Y_ = Times(Y, independent_.seen);
  }

  /// How spring-free motions move the bodies.
  MatrixX Free() const { return Times(J_u_, unsprung_.unseen); }

  void AddDoubts(const Mechanism& mechanism, const Parts& parts, std::vector<RankDoubt>& doubts) const {
    const auto add = [&](const NullSpace& decision, const char* what, const std::vector<int>& at,
                         const VectorX& motion) {
      VectorX x = VectorX::Zero(mechanism.num_coordinates());
      for (std::size_t i = 0; i < at.size(); ++i) x(at[i]) = motion(static_cast<Eigen::Index>(i));
      doubts.push_back(internal::Doubt(mechanism, what, decision.rank.kept, decision.rank.dropped, x));
    };
    if (unsprung_.doubtful.size() > 0) add(unsprung_, "loops hold", parts.unsprung, unsprung_.doubtful);
    if (independent_.doubtful.size() > 0)
      add(independent_, "loops hold", parts.looped,
          Times(felt_, independent_.doubtful).col(0).head(J_s_.cols()));
  }

  MatrixX Root(const VectorX& flexibility) const {
    const MatrixX E = ScaledRows(flexibility, E_);
    MatrixX G = -Times(E, particular_);
    G.topRows(J_s_.cols()) += ScaledColumns(J_s_, flexibility.head(J_s_.cols())).transpose();
    const MatrixX taken = GradedRangeBasis(Times(E, Y_));
    // Twice: the first leaves rounding of what it took.
    for (int pass = 0; pass < 2; ++pass) G -= Times(taken, TransposedTimes(taken, G));
    return G.transpose();
  }

 private:
  MatrixX J_s_, J_u_, E_, particular_, felt_, Y_;
  NullSpace unsprung_, independent_;
};

// Compliance along the paths of the body graph: prefix[j] = Σ S k⁻¹ Sᵀ over joints of plain paths from the root
// to j. Two bodies share the prefix of their last common joint, which is what couples them.
class PathCompliance {
 public:
  PathCompliance(const Mechanism& mechanism, const Matrix6X& S, const std::vector<int>& coordinates)
      : mechanism_(mechanism),
        prefix_(static_cast<std::size_t>(mechanism.num_joints()), Matrix6::Zero()),
        depth_(prefix_.size()) {
    for (const int i : coordinates)
      prefix_[mechanism.CoordinateJoint(i).u()] +=
          S.col(i) * (S.col(i) / mechanism.stiffness()(i)).transpose();
    for (std::size_t j = 0; j < prefix_.size(); ++j) {
      const int previous = mechanism.joints()[j].previous;
      depth_[j] = previous < 0 ? 1 : depth_[static_cast<std::size_t>(previous)] + 1;
      if (previous >= 0) prefix_[j] += prefix_[static_cast<std::size_t>(previous)];
    }
  }

  Matrix6 Between(BodyIndex a, BodyIndex b) const {
    int i = mechanism_.body(a).last_joint, j = mechanism_.body(b).last_joint;
    while (i != j) {
      const int di = i < 0 ? 0 : depth_[static_cast<std::size_t>(i)],
                dj = j < 0 ? 0 : depth_[static_cast<std::size_t>(j)];
      if (di >= dj) i = mechanism_.joint(JointIndex(i)).previous;
      if (dj >= di) j = mechanism_.joint(JointIndex(j)).previous;
    }
    return i < 0 ? Matrix6(Matrix6::Zero()) : prefix_[static_cast<std::size_t>(i)];
  }

 private:
  const Mechanism& mechanism_;
  std::vector<Matrix6> prefix_;
  std::vector<int> depth_;
};

// Twist of a body in R -> [rotation; translation of the body's origin].
Matrix6 AboutOrigin(const Kinematics& kinematics, BodyIndex b) {
  Matrix6 B = Matrix6::Identity();
  B.bottomLeftCorner<3, 3>() = -Skew(kinematics.X_RB[b.u()].translation());
  return B;
}

}  // namespace

InterfaceCompliance WalkCompliance(const Mechanism& mechanism, const VectorX& q,
                                   const std::vector<BodyIndex>& bodies, const std::vector<int>& locked) {
  const double L = mechanism.length_scale();
  Kinematics kinematics(mechanism);
  ComputeKinematics(mechanism, q, kinematics);
  const CoordinateScaling unit = ComputeCoordinateScaling(mechanism, kinematics);
  const Loops loops = CollectLoops(mechanism, kinematics, q, unit);
  const Parts parts = Divide(mechanism, loops.W, locked);
  const MatrixX J_x =
      internal::InLengths(internal::ScaledInterfaceJacobian(mechanism, kinematics, bodies, 1.0), L) *
      unit.coordinate.asDiagonal();

  const LoopedJoints looped(loops, parts, J_x);
  const internal::FreeMotions free = internal::FreeMotionsOf(looped.Free());
  const Eigen::Index joints = static_cast<Eigen::Index>(parts.looped.size()),
                     soft = loops.softness.size() - loops.rigid;
  VectorX flexibility(joints + soft);
  flexibility.head(joints) = Entries(mechanism.stiffness(), parts.looped)
                                 .cwiseSqrt()
                                 .cwiseProduct(Entries(unit.coordinate, parts.looped))
                                 .cwiseInverse();
  flexibility.tail(soft) = loops.softness.tail(soft).cwiseSqrt();
  MatrixX motions(J_x.rows(), static_cast<Eigen::Index>(parts.path.size()) + joints + soft);
  motions << Columns(J_x, parts.path), looped.Root(VectorX::Ones(joints + soft));
  InterfaceCompliance out = internal::Assemble(mechanism, looped.Root(flexibility), free, motions);

  const PathCompliance path(mechanism, kinematics.S, parts.path);
  const Eigen::Index e = static_cast<Eigen::Index>(bodies.size());
  MatrixX C(6 * e, 6 * e);
  for (Eigen::Index i = 0; i < e; ++i)
    for (Eigen::Index j = 0; j < e; ++j) {
      const BodyIndex a = bodies[static_cast<std::size_t>(i)], b = bodies[static_cast<std::size_t>(j)];
      C.block<6, 6>(6 * i, 6 * j) =
          AboutOrigin(kinematics, a) * path.Between(a, b) * AboutOrigin(kinematics, b).transpose();
    }
  out.C += internal::WithoutFree(mechanism, C, free);
  out.C = 0.5 * (out.C + out.C.transpose()).eval();
  out.locked = locked;
  looped.AddDoubts(mechanism, parts, out.doubts);
  return out;
}

}  // namespace fork1s
