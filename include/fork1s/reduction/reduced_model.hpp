// The reduced model of a mechanism: its motion as seen by the interface bodies, linear about one pose.
//
// docs/method.md, sections 3 and 4. Joint displacements are q = q_ref + Q z (+ loop correction). Joint
// coordinates that depend on each other while the base is held (a finger) have columns of Q of their own,
// which are contiguous: free directions N (no spring), elastic directions V Y_r that move the interface,
// fixed-interface modes, and load columns (static responses of the remaining DOFs), in this order. In these
// coordinates the stiffness is diagonal, 0 for free directions and 1 else.
#pragma once

#include <fork1s/base/error.hpp>
#include <fork1s/mechanism/kinematics.hpp>
#include <fork1s/mechanism/mechanism.hpp>
#include <fork1s/reduction/loop_curvature.hpp>
#include <fork1s/reduction/loop_rows.hpp>
#include <fork1s/reduction/rank_doubt.hpp>
#include <memory>
#include <string>
#include <vector>

namespace fork1s {

struct ReductionOptions {
  std::vector<BodyIndex> interfaces;  // empty: those that the mechanism's definition names
  int modes = -1;  // fixed-interface modes to keep at most; negative: the definition's number
  double rank_tolerance =
      1e-4;  // elastic directions that move the interface by less than this share of the largest are truncated
  /// A spring-free motion that moves no interface body is an error, or with this promotes its body to the interface.
  bool promote_hidden = false;
  /// s, above 0: if `modes` is negative and the definition has `modes_by_step`, all modes below 1/(6 step) are
  /// kept, up to kMostCoordinatesByStep coordinates or twice the number of the others; beyond that those of
  /// largest contribution.
  double step = 0;
};
constexpr int kMostCoordinatesByStep = 24;

/// How many fixed-interface modes are kept, and which.
struct ModeSelection {
  int count = 0;  // at most
  ModeChoice choice = ModeChoice::kLowest;
  double below_hz = 0;  // 1/(6 step) where the time step chose them, else 0
};

/// Loads whose static responses, minus their part in the other columns, are coordinates: load-dependent
/// Ritz vectors (Wilson, Yuan & Dickens 1982), docs/method.md, section 4: weight along three axes,
/// accelerations of a base that moves and of free directions, applied forces, controls that move, and all
/// joint forces at q_ref, springs included.
struct ReductionLoads {
  Vector3 gravity_R = Vector3::Zero();  // m/s²
  VectorX controls;                     // empty: none
  Matrix6X wrenches_R;                  // 6 x bodies about R's origin; empty: none
  VectorX control_change;  // as controls; each that is not 0 has a load column of its own; empty: none
};

/// Sizes: n joint coordinates, r reduced coordinates, b bodies.
struct ReducedModel {
  std::shared_ptr<const Mechanism> mechanism;
  std::vector<BodyIndex> interfaces;
  VectorX q_ref;  // n, the pose about which the model is linear

  int num_free = 0;                       // spring-free directions that move the interface
  int num_elastic = 0;                    // elastic directions that move the interface
  int num_modes = 0;                      // fixed-interface modes
  int num_loads = 0;                      // load columns
  ModeSelection mode_selection;           // later references take the same
  std::vector<std::string> column_names;  // r: "elastic 1", "mode 2", "weight z (joint that moves most)"

  MatrixX Q;                             // n x r
  VectorX K_r;                           // r: 0 for free directions, 1 else
  MatrixX M;                             // r x r
  MatrixX D;                             // r x r
  Matrix6 M_00 = Matrix6::Zero();        // inertia of the whole about R's origin
  Matrix6X M_0z;                         // 6 x r
  Matrix6X S_ref;                        // screws at q_ref, 6 x n
  std::vector<RigidTransform> X_RB_ref;  // b
  Matrix6X T;                            // 6 x (b r): T_B = T.middleCols(B r, r), twist of body B per z rate

  /// Static response q_perp = C_perp g of the condensed DOFs to joint-space forces g; it moves no interface body.
  bool has_complement = false;
  VectorX k_inverse;  // n, trees with joint springs only: C_perp = diag(k_inverse) - Q_e Q_eᵀ
  MatrixX C_perp;     // n x n otherwise

  /// Rows of the closure Jacobian that are independent at q_ref, and the inverse metric of the displacements that
  /// close them: 1 for rotations, the squared length of the mechanism for translations. With the stiffness as
  /// metric the chart of a crank-slider would end 8 degrees from its reference.
  std::vector<int> loop_rows;
  VectorX h_inverse;  // n
  // Computed from the members above by FillDerived.
  struct Run {
    int begin = 0, size = 0;
  };
  RowMatrixX Q_rows;      // Q
  std::vector<Run> runs;  // n: columns of Q, and of Q_now at any pose, that may move a coordinate
  LoopRows loops;         // those rows, group by group
  VectorX B;              // their A_ref H⁻¹: Bᵀ, the directions along which loops are closed
  // If not empty, Configure closes loops by it: to second order in z instead of exactly.
  LoopCurvature curvature;

  /// Stops, force limits and dry frictions on condensed coordinates: indices of the length limits of the mechanism,
  /// then force limits, then dry frictions. Their groups of coordinates have all elastic directions.
  std::vector<int> interior_stops;
  std::vector<BodyIndex> promoted;  // interfaces that were added for hidden motions
  std::vector<RankDoubt> doubts;    // rank decisions without a clear gap
  std::vector<std::string> warnings;

  int size() const { return static_cast<int>(K_r.size()); }
  int num_coordinates() const { return static_cast<int>(q_ref.size()); }
  int loop_rank() const { return static_cast<int>(loop_rows.size()); }
  std::vector<int> FreeColumns() const;
  std::vector<int> SprungColumns() const;
  auto T_of(BodyIndex b) const { return T.middleCols(b.value() * size(), size()); }
};

/// State of a reduced mechanism: reduced coordinates and the base.
struct ReducedState {
  VectorX z;  // r
  VectorX w;  // r, ż
  RigidTransform X_WR;
  Vector6 V_R = Vector6::Zero();  // twist of the base in R about R's origin
};

/// Reduces a mechanism about the joint displacements q_ref [n], which must close the loops.
/// Errors: kUnderdetermined names the joint of a spring-free motion that no interface body sees;
/// kModel for missing interfaces; kNumerics where a factorisation fails.
/// Without `loads` there are no load columns.
Expected<ReducedModel> Reduce(std::shared_ptr<const Mechanism> mechanism, const VectorX& q_ref,
                              const ReductionOptions& options = {}, const ReductionLoads* loads = nullptr);

/// q_perp = C_perp g, the static displacement by joint forces g that the columns of Q do not have.
void ApplyComplement(const ReducedModel& model, const VectorX& g, VectorX& q_perp);

/// Fills the derived members: rows of Q, their runs, loop rows and their directions at q_ref.
void FillDerived(ReducedModel& model);
/// q += Q z and f = Qᵀ g over the nonzero runs of Q or of Q_now. No allocation if f has its size.
void AddMotion(const ReducedModel& model, const RowMatrixX& Q, const VectorX& z, VectorX& q);
void ReduceForce(const ReducedModel& model, const RowMatrixX& Q, const VectorX& g, VectorX& f);

/// rad and m: residual at which corrections of loops end, far below the 0.01 mm that users see.
inline constexpr double kClosingTolerance = 1e-10;
/// The same where loops are to be closed as far as rounding lets them: some tens of units in the last place of the longest
/// path through a mechanism, or of a radian.
double ClosedToRounding(const Mechanism& mechanism);

/// Result and scratch of the map from reduced coordinates to joint displacements and body poses, with loops closed.
struct Configuration {
  explicit Configuration(const ReducedModel& model);

  VectorX q;  // n
  Kinematics kinematics;
  RowMatrixX Q_now;  // n x r: ∂q/∂z at the present pose (Q on trees)
  VectorX mu;        // m: q = q_ref + Q z - B µ
  double closing_tolerance = kClosingTolerance;
  int corrections = 0;       // iterations that closed the loops
  double loop_residual = 0;  // of all rows, rad and m

  // Loop scratch, m independent rows in the order of LoopRows.
  VectorX c_all, c, d, q_bar, q_move;
  VectorX A;                           // of those rows at q
  RowMatrixX W;                        // m x r in whole fours of columns: ∂µ/∂z
  LoopFactor factor;                   // of A B at some pose before
  VectorX q_bar_before, mu_before;     // of that pose
  bool has_tangent_predictor = false;  // µ of the next pose is extrapolated from these
};

constexpr int kMostCorrections = 60;

/// q(z) = q_ref + Q z - B µ with µ such that c(q) = 0 (docs/method.md, section 2): from the tangent
/// of the last pose by chords with the factor at hand, a new factor where they gain too little, at most
/// `max_corrections`; 0 leaves the loops open. Since B stays, Q_now = (1 - B (A B)⁻¹ A) Q is the derivative
/// of the pose that is computed. A model with curvature has µ = ½ N[z, z] instead, Q_now = Q - B N z, the
/// derivative of that pose, and loops open by the third order of z. Fills kinematics. No allocation.
void Configure(const ReducedModel& model, const ReducedState& state, Configuration& out,
               int max_corrections = kMostCorrections);

/// The same pose without the derivative: Q_now, A and the factor stay those of an earlier pose.
void ConfigurePose(const ReducedModel& model, const ReducedState& state, Configuration& out);

/// As Configure where µ in `out` is known to close the loops: the bits that Configure left at this state.
void ConfigureClosed(const ReducedModel& model, const ReducedState& state, Configuration& out);

/// Removes constraint reactions from joint forces: g -= Aᵀ(A B)⁻ᵀ Bᵀ g at the pose of `c`, which leaves the work on
/// displacements that close loops along B. With curvature no change, since µ does not follow such displacements.
/// No allocation.
void RemoveConstraintReactions(const ReducedModel& model, Configuration& c, VectorX& g);

}  // namespace fork1s
