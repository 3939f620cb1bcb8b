// The immutable mechanism: bodies in a spanning tree, joints as constant screws, closures, springs.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <fork1s/mechanism/definition.hpp>
#include <fork1s/spatial/screw_motion.hpp>
#include <string>
#include <utility>
#include <vector>

namespace fork1s {

/// A validated mechanism, cheap to copy references to and never changed.
///
/// Letters: n = number of joint coordinates; q [n] = displacements from the reference; all screws are
/// in the root frame R, about R's origin, at q = 0. Coordinates of one joint are consecutive, joints
/// are sorted so that those nearer the root come first.
class Mechanism {
 public:
  struct Body {
    std::string name;
    BodyIndex parent;      // invalid for the base
    int last_joint = -1;   // last joint on the path from the root, -1 if none
    RigidTransform X_RB0;  // pose in R at q = 0
    SpatialInertia inertia_B;
    double weighed_mass = 0;    // kg that gravity acts on: without the share that is compensated
    SpatialInertia inertia_R0;  // the same seen from R at q = 0
  };
  struct Joint {
    std::string name;
    JointKind kind;
    BodyIndex body;
    int previous = -1;  // the joint before it on the path from the root, -1 if none
    int offset = 0;     // first coordinate
    int size = 0;       // number of freedoms
    int rotation = -1;  // index in rotations(), -1: none
  };
  /// A joint with a rotation vector θ of three coordinates (ball, free, general with three rotations). Its dampers,
  /// armature, dry friction and motors act on the angular velocity ω = E(q) θ̇ along its axes W, which move with the
  /// body that it carries (AngularVelocityMap); its springs and limits act on θ.
  struct Rotation {
    JointIndex joint;
    std::array<int, 3> coordinates;  // of θ
    Matrix3 axes, axes_inverse;      // W, W⁻¹: columns are the axes in R at q = 0
  };
  /// Σ coefficient q[index]
  using LinearForm = std::vector<std::pair<int, double>>;
  /// A length that springs, stops and motors act on, counted from the reference: Σ coefficient q[index] plus
  /// gear (length of a path - its length at q = 0). What it is at a pose: LengthOf, ForEachArm.
  struct Length {
    LinearForm terms;
    int path = -1;  // index in paths(); -1: none
    double gear = 0;

    /// One coordinate alone.
    bool is_single() const { return path < 0 && terms.size() == 1; }
  };
  /// A tendon through space or another path: its definition, and the coordinates that may change its length.
  struct Path {
    std::string name;
    std::vector<PathElementDef> elements;
    PathKind kind;
    double rod;
    Vector6 gear;
    std::vector<int> coordinates;  // ascending
    std::vector<int> slot;         // per coordinate: its place among those, -1
    double at_reference = 0;       // m, at q = 0
    LinearForm
        rates;  // not empty: the arms are those of Σ coefficient ω[index], the length is Σ coefficient θ[index]
    bool has_potential =
        true;  // its arms are the derivatives of its length, and a spring on it stores energy
  };
  struct Spring {
    std::string name;
    Length length;
    double stiffness, damping, rest;
    std::array<double, 2> higher_stiffness = {}, higher_damping = {};
    double slack = 0;
    // Above 0, as of a muscle's passive part: it only pulls, and its stiffness grows evenly from 0 at the stretch 0 to
    // `stiffness` at this one.
    double toe = 0;

    /// Where it is, the matrix of a stage keeps the stiffness of the reference: whatever bends force or damper
    /// counts here.
    bool is_linear() const {
      const std::array<double, 2> none = {};
      return higher_stiffness == none && higher_damping == none && slack == 0 && toe == 0;
    }
    /// -1: shorter than where it is slack, 1: longer, 0: slack. Without slack it always is one of the two.
    int SideOf(double at) const { return at < rest ? -1 : at > rest + slack || slack == 0 ? 1 : 0; }
    /// Beyond the nearer end of where it is slack.
    double Stretch(double at) const {
      const int side = SideOf(at);
      return side == 0 ? 0 : side < 0 ? at - rest : at - rest - slack;
    }
    /// Pull of the spring at a length, without its damper.
    double Force(double at) const {
      const double s = Stretch(at);
      if (toe > 0) return s <= 0 ? 0 : -stiffness * (s < toe ? s * s / (2 * toe) : s - toe / 2);
      return -s * (stiffness + s * (higher_stiffness[0] + s * higher_stiffness[1]));
    }
    double Energy(double at) const {
      const double s = Stretch(at);
      if (toe > 0)
        return s <= 0    ? 0
               : s < toe ? stiffness * s * s * s / (6 * toe)
                         : stiffness * (toe * toe / 6 + s * (s - toe) / 2);
      return s * s * (stiffness / 2 + s * (higher_stiffness[0] / 3 + s * higher_stiffness[1] / 4));
    }
    /// How the pull falls with the length; 0 where it grows, and nothing would hold by it.
    double StiffnessAt(double at) const { return SideOf(at) == 0 ? 0 : StiffnessOf(Stretch(at)); }
    /// The same by the stretch.
    double StiffnessOf(double s) const {
      if (toe > 0) return stiffness * std::min(std::max(s / toe, 0.0), 1.0);
      return std::max(0.0, stiffness + s * (2 * higher_stiffness[0] + 3 * s * higher_stiffness[1]));
    }
    /// Share of the rate that the damper's force is; never negative.
    double DampingAt(double rate) const {
      return std::max(0.0, damping + std::abs(rate) * higher_damping[0] + rate * rate * higher_damping[1]);
    }
  };
  /// The active part of a muscle. Its passive part is a spring of the same name.
  struct Muscle {
    std::string name;
    Length length;
    int control;              // in controls(), by whose activation a the force is multiplied
    double force;             // N
    double optimum, zero;     // m: L = (length - zero) / optimum
    double lmin, lmax, vmax;  // vmax: 1/s
    double fvmax;

    /// At a = 1 [N], and its derivatives by the length and by the rate.
    double Force(double at, double rate) const;
    double ForceByLength(double at, double rate) const;
    double ForceByRate(double at, double rate) const;
  };
  struct Coupling {
    std::string name;
    int a;       // coordinate
    int b = -1;  // coordinate or -1
    double polynomial[5];
    LinearForm terms;  // of coordinates, neither a nor b

    /// a, b and those of the terms, each once.
    std::vector<int> Coordinates() const {
      std::vector<int> all = {a};
      if (b >= 0) all.push_back(b);
      for (const auto& term : terms) all.push_back(term.first);
      return all;
    }
    /// c(q) = q_a - polynomial(q_b) - Σ coefficient q, 0 where it holds.
    double Residual(const VectorX& q) const {
      const double x = b >= 0 ? q(b) : 0, *p = polynomial;
      double c = q(a) - (p[0] + x * (p[1] + x * (p[2] + x * (p[3] + x * p[4]))));
      for (const auto& [i, coefficient] : terms) c -= coefficient * q(i);
      return c;
    }
    /// Calls f(i, ∂c/∂q_i) in the order of Coordinates.
    template <class F>
    void ForEachSlope(const VectorX& q, F&& f) const {
      f(a, 1.0);
      if (b >= 0) {
        const double x = q(b), *p = polynomial;
        f(b, -(p[1] + x * (2 * p[2] + x * (3 * p[3] + x * 4 * p[4]))));
      }
      for (const auto& [i, coefficient] : terms) f(i, -coefficient);
    }
    /// ∂²c/∂q_b², the only second derivative of c that may differ from 0; b must be valid.
    double SecondDerivative(const VectorX& q) const {
      const double x = q(b), *p = polynomial;
      return -(2 * p[2] + x * (6 * p[3] + x * 12 * p[4]));
    }
  };
  struct Control {
    std::string name;
    Length length;
    double gain, lower, upper, initial;
  };

  struct DryFriction {
    std::string name;
    Length length;
    double force;
  };
  struct LengthLimit {
    std::string name;
    Length length;
    double lower, upper;
    bool is_of_joint;

    /// "joint 'elbow'", "tendon 'flexor'"
    std::string WhatAndName() const { return (is_of_joint ? "joint '" : "tendon '") + name + "'"; }
  };
  struct ForceLimit {
    std::string name;
    Length length;
    LinearForm inputs;  // control, share times gain
    double stiffness, damping, rest, lower, upper;
  };

  const MechanismDef& definition() const { return definition_; }
  const std::string& name() const { return definition_.name; }
  BaseKind base() const { return definition_.base; }

  const std::vector<Body>& bodies() const { return bodies_; }
  const std::vector<Joint>& joints() const { return joints_; }
  const std::vector<Rotation>& rotations() const { return rotations_; }
  const std::vector<ClosureDef>& closures() const { return definition_.closures; }
  const std::vector<Coupling>& couplings() const { return couplings_; }
  /// Those of the definition, then those of forces that act on the angular velocity of a joint.
  const std::vector<Path>& paths() const { return paths_; }
  /// Whether a length is that of a spatial tendon, times a gear.
  bool IsTendon(const Length& length) const {
    return length.path >= 0 && length.terms.empty() &&
           paths_[static_cast<std::size_t>(length.path)].kind == PathKind::kTendon &&
           paths_[static_cast<std::size_t>(length.path)].rates.empty();
  }
  const std::vector<Spring>& springs() const { return springs_; }
  const std::vector<Control>& controls() const { return controls_; }
  const std::vector<Muscle>& muscles() const { return muscles_; }
  /// Those of muscles are the last springs.
  const Spring& PassivePart(std::size_t muscle) const {
    return springs_[springs_.size() - muscles_.size() + muscle];
  }
  const std::vector<DryFriction>& frictions() const { return frictions_; }
  const std::vector<ForceLimit>& force_limits() const { return force_limits_; }
  /// Those of single coordinates first.
  const std::vector<LengthLimit>& length_limits() const { return length_limits_; }
  /// Whether a force that hangs on this length alone has a potential: the arms of a wrench between frames are
  /// not the derivatives of a length.
  bool HasPotential(const Length& length) const {
    return length.path < 0 || paths_[static_cast<std::size_t>(length.path)].has_potential;
  }
  /// Coordinates that a length may depend on, each once for every term.
  std::vector<int> CoordinatesOf(const Length& length) const;
  const Body& body(BodyIndex i) const { return bodies_[i.u()]; }
  const Joint& joint(JointIndex i) const { return joints_[i.u()]; }

  int num_bodies() const { return static_cast<int>(bodies_.size()); }
  int num_joints() const { return static_cast<int>(joints_.size()); }
  int num_coordinates() const { return static_cast<int>(stiffness_.size()); }
  /// Rows of rigid closures and couplings.
  int num_constraints() const { return num_constraints_; }
  bool is_tree() const { return num_constraints_ == 0 && num_springy_rows_ == 0; }
  /// Springs act on single coordinates only, so that the stiffness matrix is diagonal.
  bool has_diagonal_stiffness() const { return springs_.empty() && num_springy_rows_ == 0; }

  const Matrix6X& screws() const { return screws_; }  // 6 x n
  /// Exp of each screw, of joints of one freedom alone what the joint does.
  const std::vector<ScrewMotion>& screw_motions() const { return screw_motions_; }  // n
  /// Whether a coordinate is an angle [rad], by itself or along a screw; else a way [m].
  bool Turns(int coordinate) const { return !screws_.col(coordinate).head<3>().isZero(0); }
  /// Whether a length is an angle [rad], and not in m: one that mixes turns and slides is in m.
  bool IsAngle(const Length& length) const {
    if (length.path >= 0) return paths_[static_cast<std::size_t>(length.path)].kind == PathKind::kAngle;
    return !length.terms.empty() && std::all_of(length.terms.begin(), length.terms.end(),
                                                [&](const auto& term) { return Turns(term.first); });
  }
  const VectorX& stiffness() const { return stiffness_; }  // n, of each coordinate's own spring
  const VectorX& damping() const { return damping_; }      // n
  const VectorX& armature() const { return armature_; }    // n
  const VectorX& rest() const { return rest_; }            // n
  const VectorX& lower() const { return lower_; }          // n
  const VectorX& upper() const { return upper_; }          // n
  double total_mass() const { return total_mass_; }
  double weighed_mass() const { return weighed_mass_; }
  /// Mean distance [m] between successive joints: the length that makes rotations and translations
  /// comparable in rank decisions and tolerances.
  double length_scale() const { return length_scale_; }

  /// Rigid parts that never touch each other but by explicit pairs: across a joint as
  /// MechanismDef::parent_filter says, and across a closure. Each part by the last joint of its bodies; -1:
  /// the base.
  std::vector<std::pair<int, int>> FilteredContacts() const;
  BodyIndex FindBody(const std::string& name) const { return definition_.FindBody(name); }
  /// Name of the joint that owns coordinate i, with its freedom if it has several.
  std::string CoordinateName(int i) const;
  /// Joint that owns coordinate i.
  JointIndex CoordinateJoint(int i) const {
    return JointIndex(coordinate_joint_[static_cast<std::size_t>(i)]);
  }

 private:
  friend Expected<Mechanism> BuildMechanism(MechanismDef definition);

  MechanismDef definition_;
  std::vector<Body> bodies_;
  std::vector<Joint> joints_;
  std::vector<Rotation> rotations_;
  std::vector<int> coordinate_joint_;
  std::vector<Coupling> couplings_;
  std::vector<Path> paths_;
  std::vector<Spring> springs_;
  std::vector<Control> controls_;
  std::vector<Muscle> muscles_;
  std::vector<DryFriction> frictions_;
  std::vector<ForceLimit> force_limits_;
  std::vector<LengthLimit> length_limits_;
  Matrix6X screws_;
  std::vector<ScrewMotion> screw_motions_;
  VectorX stiffness_, damping_, armature_, rest_, lower_, upper_;
  int num_constraints_ = 0;
  int num_springy_rows_ = 0;
  double total_mass_ = 0, weighed_mass_ = 0;
  double length_scale_ = 1;
};

/// Validates a definition and builds the mechanism. Errors (ErrorCode::kModel) name the body, joint or
/// closure at fault: missing parents, several roots, names used twice, non-finite numbers, negative
/// mass or stiffness, a moving part without inertia, dependent freedoms, closures on themselves.
/// The definition's joints are sorted by depth; `definition()` of the result holds them in that order.
Expected<Mechanism> BuildMechanism(MechanismDef definition);

/// Every joint and tendon spring times `factor`, every joint damper times √factor, servo gains with them.
MechanismDef ScaleStiffness(MechanismDef definition, double factor);

}  // namespace fork1s
