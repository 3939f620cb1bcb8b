// Contacts, moments and limits of one problem as functions of d, and their sum F(d).
//
// A velocity block has freedoms of its own in which its implicit operator is the identity: d = Lᵀ(v − v*)
// with A = L Lᵀ, so that a port sees v*_port + Yᵀ d, Y = L⁻¹ J_portᵀ, and with G = J Yᵀ the rows of a contact
//     F(d) = d − Σ Gᵀ λ(u* + bias − R λ₀ + G d) = 0
// is the equation of the problem. λ₀ are the tangential impulses of the last step, which prevent creep. The cost is
// linear in the contacts: each adds to the 6 x 6 blocks of its two ports, which are mapped to freedoms once per
// port and pair.
#pragma once

#include <algorithm>
#include <cmath>
#include <fork1s/constraints/contact_solver.hpp>
#include <limits>
#include <memory>
#include <vector>

#include "block_freedoms.hpp"
#include "elimination_order.hpp"
#include "laws/bounds.hpp"
#include "laws/friction_cone.hpp"
#include "laws/moment_bounds.hpp"
#include "port_rows.hpp"

namespace fork1s::internal {

constexpr double kRounding = std::numeric_limits<double>::epsilon();

/// Compliance of a point and its inverse inertia.
struct PointCompliance {
  double R_n = 0, R_t = 0;                    // 1/kg
  Vector3 R_turn = Vector3::Zero();           // 1/(kg m²), of moments about normal and tangents
  double least_R = 0;                         // before anything cancels
  double unloaded_R_n = 0;                    // of the material
  double hardening_speed = 0;                 // m/s: ContactConstraint::hardening_speed
  double inverse_mass = 0;                    // tr(G Gᵀ)/3
  Vector3 inverse_inertia = Vector3::Zero();  // about normal and tangents
  bool is_moved = true;                       // by any freedom; otherwise it has no impulse and no R

  /// R_n of the material under an impulse (ContactConstraint::hardening_speed).
  double LoadedR_n(double impulse) const {
    const double linear = impulse * unloaded_R_n;
    if (!(linear > hardening_speed)) return unloaded_R_n;
    static_assert(ContactConstraint::kHardeningExponent == 8);
    return hardening_speed / impulse * std::sqrt(std::sqrt(std::sqrt(linear / hardening_speed)));
  }
};

/// Relative velocity w = base + offset + G d of a point, and its relative angular velocity in the same form.
struct PointVelocity {
  Vector3 start = Vector3::Zero();   // u* + bias
  Vector3 base = Vector3::Zero();    // u* + bias − R λ₀
  Vector3 offset = Vector3::Zero();  // of a stage
  Vector3 shift = Vector3::Zero();   // of w without friction, on a path
  Vector3 w = Vector3::Zero();       // as last evaluated, of closed points
};
struct PointTurning {
  Vector3 start = Vector3::Zero(), base = Vector3::Zero(), offset = Vector3::Zero();
};

/// Impulses of the last step, λ₀.
struct PreviousImpulse {
  Vector2 tangents = Vector2::Zero();
  double normal = 0, utilization = 0;
  Vector3 moment = Vector3::Zero();
  bool fades = false;
  Vector2 least = Vector2::Zero();  // the value that `tangents` relax to
};

/// The linearization of the law that a point is on.
struct LawLinearization {
  ContactMode mode = ContactMode::kOpen;
  Matrix3 D = Matrix3::Zero(), D_turn = Matrix3::Zero();                // −∂λ/∂w, −∂m/∂turning
  Vector3 turn_by_normal = Vector3::Zero();                             // −∂m/∂w_n
  Vector3 by_share = Vector3::Zero(), turn_by_share = Vector3::Zero();  // ∂λ/∂σ, ∂m/∂σ
  bool is_clear = true;                                                 // these are all 0

  /// Open: zero impulse at any velocity.
  void Clear() {
    if (is_clear)
      mode = ContactMode::kOpen;
    else
      *this = {};
  }
};

struct PointRows {
  PaddedRows rows_a = PaddedRows::Zero(), rows_b = PaddedRows::Zero();  // of J
  Vector3 scale = Vector3::Ones();  // of the rows: tangents in which friction is isotropic
  FrictionCone law;                 // of the stage at hand
  MomentBounds moments;             // likewise
  bool has_moments = false;
  PointCompliance compliance;
  PointVelocity velocity;
  PointTurning turning;
  PreviousImpulse previous;
  LawLinearization linearization;
  Vector3 impulse = Vector3::Zero(), moment = Vector3::Zero();
  double utilization = 0;  // |y| as a share of its bound
  double frozen_before = 0;
  double reach = 0;  // size of w before anything cancels
  double noise = 0;  // rounding of Gᵀ λ
  double off2 = 0;   // |λ − Π(y)|² as inertia weighs it

  /// Whether it contributes to ∂F/∂d: open points do if their friction bound is held fixed.
  bool CarriesLoad() const { return linearization.mode != ContactMode::kOpen || law.frozen_normal > 0; }
  bool HasMoments() const { return has_moments; }
  /// Open: zero impulse at any velocity.
  void ClearLinearization() {
    linearization.Clear();
    utilization = 0;
  }
  /// Projects impulse and moment onto the cone.
  void ProjectToCone() {
    impulse = law.Project(impulse);
    for (int k = 0; k < 3; ++k) moment[k] = moments.At(k, impulse[0]).Project(moment[k]);
  }
  /// Friction bound at the normal impulse of the last step.
  double PreviousBound() const { return law.Bound(previous.normal); }
  /// Compliances of the stage; those of moments scale as the tangential one.
  void SetCompliance(double normal, double tangential) {
    law.R_n = normal;
    law.R_t = tangential;
    if (has_moments) moments.R = compliance.R_turn * (tangential / compliance.R_t);
  }
};

/// Points of one pair of ports, one after another.
struct PairRows {
  int port_a = -1, port_b = -1;        // of `ports`
  int next_of_a = -1, next_of_b = -1;  // pair of the same port
  int first = 0, count = 0;
  double R_n = 0, R_t = 0, least_R = 0;
  double material_R_n = 0, material_R_t = 0;  // before any load makes it stiffer
  bool gives_way = false;                     // as ContactConstraint
};

struct LimitRows {
  const double* Y = nullptr;  // freedoms
  int begin = 0, freedoms = 0;
  Span spans[2];  // of these freedoms, that move it
  int row = 0;
  double sign = 1, base = 0, offset = 0;
  BoundLaw law;  // of the stage at hand
  double material_R = 0, inverse_mass = 0;
  double impulse = 0, D = 0;
  double reach = 0;     // size of v* and bias, before they cancel
  double constant = 0;  // of the mode at hand: λ = constant − D w
  double at_rest = 0;   // and at d = 0
  double off2 = 0, w = 0;
};

inline double Dot(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += a[i] * b[i];
  return sum;
}

class TangentRows;

class RegularizedContactProblem {
 public:
  RegularizedContactProblem();
  ~RegularizedContactProblem();
  void Reserve(int num_contacts, int num_limits, int num_velocities, int num_freedoms);
  /// Of contacts those that are `taken`. False where a number is not finite.
  bool Prepare(const std::vector<VelocityBlock>& blocks, const std::vector<ContactConstraint>& contacts,
               const std::vector<int>& taken, const std::vector<LimitConstraint>& limits,
               const Eigen::Ref<const VectorX>& velocities, double max_relative_regularization);
  /// The linearizations of the law that (d, λ) are on, λ those at hand: λ = −D w. Then H d = right side is
  /// where the modes would lead, and `ComputeLinearizedImpulses` what they bear there, with that much more of
  /// friction. How far (d, λ) are from the law itself: `law_gap`, and the rounding in it. `first`: λ are a
  /// guess by the last step, and what slid then is taken to go on.
  void UpdateModes(const double* d, bool first = false);
  /// How far (d, λ) are from the law, point by point and row by row; modes stay those at hand.
  void MeasureLaw(const double* d);
  /// |λ − Π(y)|, weighed as F is (contact_modes.cpp).
  double law_gap() const { return law_gap_; }
  double law_noise() const { return law_noise_; }
  void ComputeLinearizedImpulses(const double* d, double more_share = 0);
  /// Share σ of friction and radii that the law at hand has, and 1 − σ of the points' shifts.
  void SetFrictionShare(double share);
  /// Sum of Gᵀ ∂λ/∂σ over the modes at hand.
  void PushByShare(double* into);
  /// w of a point at the d that was looked at last, and its turning beside that.
  Vector3 Speed(const PairRows& pair, const PointRows& point) const;
  Vector3 Turning(const PairRows& pair, const PointRows& point) const;
  /// λ −= D G s.
  void MoveInFixedModes(const double* s);
  const std::vector<double>& right_side() const { return push_; }
  /// The impulses at d and F. With `with_derivative` the modes too that they are on.
  void Evaluate(const double* d, bool with_derivative);
  /// H = ∂F/∂d of the modes at hand; freedoms x freedoms. By blocks: but for what order() passes over.
  void Derivative(double* H);
  void DerivativeByBlocks(double* H);
  /// Sum of Gᵀ λ over the impulses at hand.
  void Push(double* into);
  /// The answer's twists: velocities += Yᵀ d.
  void AddChange(const double* d, Eigen::Ref<VectorX> velocities) const;
  /// R' = max(R, share of the inverse mass) about the impulses at hand; share 0: the material's.
  void IncreaseRegularization(double share);
  /// Whether the impulses at hand press pairs in too deep that do not give way.
  bool IsPressedIn() const;
  /// Makes these pairs stiffer. False where nothing changes.
  bool DecreaseRegularization();
  /// Between these two calls contact is hard, to be solved for what presses. A pair that gives as much then is pressed by
  /// what no force holds up: it gives way, with its material's compliance. All else, the impulses included, is as before.
  /// `solved`: whether it was.
  void BeginProbe();
  void EndProbe(bool solved);
  /// Original place of points[i].
  int place(std::size_t i) const { return order_[i]; }

  int freedoms() const { return blocks_.count(); }
  /// In which freedoms are eliminated, by what touches what.
  const EliminationOrder& order() const { return elimination_; }
  /// Of the last evaluation: F, |Σ Gᵀ λ|, |F|, the rounding in it.
  const std::vector<double>& F() const { return F_; }
  double push_norm() const { return push_norm_; }
  double F_norm() const { return F_norm_; }
  double noise() const { return noise_; }
  bool Reached(double tolerance) const { return F_norm_ <= tolerance * push_norm_ + noise_; }

  std::vector<PortRows> ports;
  std::vector<PairRows> pairs;
  std::vector<PointRows> points;
  std::vector<LimitRows> limits;

 private:
  void FindOrder();
  bool PreparePoint(const ContactConstraint& in, const PairRows& pair, PointRows& out,
                    const Eigen::Ref<const VectorX>& velocities) const;
  bool PrepareLimit(const LimitConstraint& in, LimitRows& out,
                    const Eigen::Ref<const VectorX>& velocities) const;
  void RespondMoments(PointRows& point, const Vector3& turning, bool with_derivative) const;
  double NormalSpeed(const PairRows& pair, const PointRows& point) const;
  void ClearPush();
  void AddDerivatives(double* H);
  void AddPush(const PairRows& pair, const PointRows& point, const Vector3& impulse, const Vector3& moment);
  void AddDerivative(std::size_t pair, const PointRows& point);
  void UpdateMode(const PairRows& pair, PointRows& point, bool first);
  void UpdateMoments(PointRows& point, const Vector3& turning, double y_n, bool with_piece);
  double EvaluateLimit(LimitRows& limit, const double* d);
  double NoiseOfCancellation() const;
  double AddGap(double inverse_mass, double gap2, double rounding);
  double AddGap(PointRows& point, double gap2);
  void SetPairCompliance(PairRows& pair, double max_relative_regularization);
  void ApplyPairCompliance(const PairRows& pair);
  void RelaxInternalForces();
  struct Pressed {
    double given = 0, share = 1;
  };
  Pressed PressedIn(const PairRows& pair) const;
  bool FindLeastByFreedoms();
  void GatherPush(double LimitRows::*borne);
  void SetDiagonal(double diagonal, double* H) const;
  /// H += Σ Y S Yᵀ (blocks.cpp)
  void AddBlocks(double* H);
  void AddLeftProduct(const PortRows& left, const PaddedBlock& S);
  void AddRightProduct(const double* Y, int stride, int begin, int count, double* H) const;

  BlockFreedoms blocks_;
  std::vector<int> order_;
  EliminationOrder elimination_;
  double push_norm_ = 0, F_norm_ = 0, noise_ = 0;
  double law_gap_ = 0, law_noise_ = 0;
  std::vector<double> push_, F_;
  std::vector<PaddedBlock> S_ab_, S_ba_;  // a pair
  std::unique_ptr<TangentRows> tangents_;
  struct {  // of FindLeastByFreedoms
    std::vector<double> H, x;
  } internal_forces_;
  struct {  // as they were
    std::vector<PairRows> pairs;
    std::vector<PointRows> points;
    std::vector<LimitRows> limits;
    std::vector<double> given;  // of pairs, m/s
  } probe_;
  struct {                    // of AddBlocks
    std::vector<double> U;    // freedoms x 6
    std::vector<Span> spans;  // rows of U that are not zero
  } block_scratch_;
};

}  // namespace fork1s::internal
