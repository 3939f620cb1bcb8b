// Random mechanisms and states for property tests. The same seed gives the same mechanism with every compiler
// and standard library: numbers come straight from the engine, not from std distributions.
#pragma once

#include <algorithm>
#include <fork1s/mechanism/builder.hpp>
#include <fork1s/mechanism/kinematics.hpp>
#include <random>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "linalg/spectrum.hpp"

namespace fork1s::testing {

class RandomSource {
 public:
  explicit RandomSource(unsigned seed) : engine_(seed * 2654435761u + 1u) {}
  double Uniform(double low, double high) {
    return low + (high - low) * static_cast<double>(engine_()) / 4294967296.0;
  }
  /// An integer in [0, count).
  int Below(int count) { return static_cast<int>(engine_() % static_cast<unsigned>(count)); }
  bool Chance(double p) { return Uniform(0, 1) < p; }
  Vector3 InBox(double half) {
    const double x = Uniform(-half, half), y = Uniform(-half, half), z = Uniform(-half, half);
    return {x, y, z};
  }
  Vector3 Direction() {
    for (;;) {
      const Vector3 v = InBox(1);
      if (v.norm() > 0.1 && v.norm() < 1) return v.normalized();
    }
  }
  Vector6 Six(double half) {
    Vector6 x;
    for (int i = 0; i < 6; ++i) x(i) = Uniform(-half, half);
    return x;
  }
  /// Any rotation; translation at most `reach` [m] along each axis.
  RigidTransform Pose(double reach) {
    const Vector3 axis = Direction();
    const double angle = Uniform(-3, 3);
    return {ExpRotation(angle * axis), InBox(reach)};
  }
  VectorX Vector(int n, double half) {
    VectorX v(n);
    for (int i = 0; i < n; ++i) v(i) = Uniform(-half, half);
    return v;
  }
  /// 0.2 to 2 kg as six point masses within about 0.1 m: a physically possible inertia.
  SpatialInertia Inertia() {
    SpatialInertia I;
    const Vector3 middle = InBox(0.1);
    std::vector<std::pair<double, Vector3>> points;
    Vector3 moment = Vector3::Zero();
    for (int i = 0; i < 6; ++i) {
      const double mass = Uniform(0.03, 0.33);
      points.emplace_back(mass, middle + InBox(0.1));
      I.mass += mass;
      moment += mass * points.back().second;
    }
    I.center = moment / I.mass;
    for (const auto& [mass, p] : points) {
      const Matrix3 r = Skew(p - I.center);
      I.rotational -= mass * r * r;
    }
    return I;
  }

 private:
  std::mt19937 engine_;
};

struct RandomMechanismOptions {
  int bodies = 8;  ///< moving bodies, the base not counted
  BaseKind base = BaseKind::kFixed;
  bool hinges_only = false;  ///< false: every kind of joint, several on one body, bodies without any
  double chain = 0.5;        ///< chance that a body hangs on the one before it, not on any earlier one
  double unsprung = 0;       ///< chance that a joint has no stiffness
  double stiffness_low = 5;  ///< N·m/rad or N/m
  double stiffness_high = 200;
  double damping_ratio = 0.02;  ///< damping = this * stiffness [s], times a random number in [0.2, 1]
  bool armature = true;
  bool rest = false;          ///< springs unloaded away from the reference
  int rigid_closures = 0;     ///< hinge-like, connect, weld, ... closed at the reference; see note below
  int springy_closures = 0;   ///< random springy directions, unloaded at the reference
  int couplings = 0;          ///< polynomials through the origin, so closed at the reference
  int coupling_terms = 0;     ///< further joints of each coupling
  int springs = 0;            ///< tendons over two to four freedoms
  bool bent_springs = false;  ///< with higher terms
  double slack = 0;           ///< springs are slack over up to this
  int controls = 0;
  int bounded_servos = 0;       ///< springs over one or two freedoms with set-points and bounds of force
  int interfaces = 2;           ///< the last leaves
  bool joints_in_order = true;  ///< false: joints are added out of body order
};

namespace internal {

inline JointDef RandomJoint(RandomSource& random, const std::string& name, BodyIndex body, bool hinge) {
  const Vector3 axis = random.Direction();
  const Vector3 anchor = random.InBox(0.1);
  switch (hinge ? 0 : random.Below(8)) {
    case 0:
    case 1:
      return JointDef::Hinge(name, body, axis, anchor);
    case 2:
      return JointDef::Slide(name, body, axis);
    case 3:
      return JointDef::Ball(name, body, anchor);
    case 4:
      return JointDef::Cylindrical(name, body, axis, anchor);
    case 5:
      return JointDef::Planar(name, body, axis, anchor);
    case 6:
      return JointDef::Free(name, body);
    default: {
      Matrix6X S(6, 1 + random.Below(3));
      for (Eigen::Index i = 0; i < S.cols(); ++i) S.col(i) = random.Six(1);
      return JointDef::General(name, body, S);
    }
  }
}

/// Freedoms that repeat each other on one body would leave the mass matrix singular.
inline bool Independent(const JointDef& first, const JointDef& second) {
  Matrix6X S(6, static_cast<Eigen::Index>(first.freedoms.size() + second.freedoms.size()));
  Eigen::Index column = 0;
  for (const JointDef* joint : {&first, &second})
    for (const FreedomDef& f : joint->freedoms) S.col(column++) = f.screw_B;
  if (S.cols() > 6) return false;
  const VectorX sigma = SingularValues(S);
  return sigma(sigma.size() - 1) > 0.05 * sigma(0);
}

/// Joint freedoms on the loop through a and b.
inline int LoopFreedoms(const Mechanism& m, BodyIndex a, BodyIndex b) {
  std::vector<bool> on_a(static_cast<std::size_t>(m.num_joints()), false);
  int count = 0;
  for (int j = m.body(a).last_joint; j >= 0; j = m.joint(JointIndex(j)).previous) {
    on_a[static_cast<std::size_t>(j)] = true;
    count += m.joint(JointIndex(j)).size;
  }
  for (int j = m.body(b).last_joint; j >= 0; j = m.joint(JointIndex(j)).previous)
    count += on_a[static_cast<std::size_t>(j)] ? -m.joint(JointIndex(j)).size : m.joint(JointIndex(j)).size;
  return count;
}

inline FreedomRef RandomFreedom(RandomSource& random, const MechanismDef& def) {
  const int j = random.Below(static_cast<int>(def.joints.size()));
  return {JointIndex(j),
          random.Below(static_cast<int>(def.joints[static_cast<std::size_t>(j)].freedoms.size()))};
}

inline int FlatIndex(const FreedomRef& ref) { return ref.joint.value() * 8 + ref.freedom; }

/// Frames that coincide at the reference, given where on body a.
inline void PlaceClosure(RandomSource& random, const Mechanism& m, ClosureDef& c) {
  c.X_AJ = random.Pose(0.15);
  c.X_BJ = m.body(c.body_b).X_RB0.inverse() * m.body(c.body_a).X_RB0 * c.X_AJ;
}

inline void AddRigidClosures(RandomSource& random, int wanted, const Mechanism& tree, MechanismDef& def,
                             int& spare) {
  for (int attempt = 0, made = 0; attempt < 200 * wanted && made < wanted; ++attempt) {
    ClosureDef c;
    c.name = "closure" + std::to_string(made + 1);
    c.body_a = BodyIndex(random.Below(tree.num_bodies()));
    c.body_b = BodyIndex(random.Below(tree.num_bodies()));
    if (c.body_a == c.body_b) continue;
    switch (random.Below(5)) {
      case 0:
        c.rigid.setConstant(true);
        break;  // weld
      case 1:
        c.rigid << false, false, false, true, true, true;
        break;  // connect
      case 2:
        c.rigid << true, true, false, true, true, true;
        break;  // hinge along z
      case 3:
        c.rigid << false, false, false, false, false, true;
        break;  // point on a plane
      default:
        c.rigid << true, true, false, false, false, true;
        break;  // plane on a plane
    }
    const int rows = static_cast<int>(c.rigid.count());
    // The loop must keep a freedom, and all loops together must leave some.
    if (LoopFreedoms(tree, c.body_a, c.body_b) <= rows || spare <= rows + 1) continue;
    spare -= rows;
    PlaceClosure(random, tree, c);
    def.closures.push_back(c);
    ++made;
  }
}

inline void AddSpringyClosures(RandomSource& random, const RandomMechanismOptions& options,
                               const Mechanism& tree, MechanismDef& def) {
  for (int i = 0; i < options.springy_closures && tree.num_bodies() > 1; ++i) {
    ClosureDef c;
    c.name = "bushing" + std::to_string(i + 1);
    c.body_a = BodyIndex(random.Below(tree.num_bodies()));
    c.body_b = BodyIndex((c.body_a.value() + 1 + random.Below(tree.num_bodies() - 1)) % tree.num_bodies());
    for (int k = 0; k < 6; ++k) {
      if (k > 0 && random.Chance(0.3)) continue;  // free in this direction
      c.stiffness(k) = random.Uniform(options.stiffness_low, options.stiffness_high);
      c.damping(k) = c.stiffness(k) * options.damping_ratio * random.Uniform(0.2, 1);
    }
    PlaceClosure(random, tree, c);
    def.closures.push_back(c);
  }
}

inline void AddConnections(RandomSource& random, const RandomMechanismOptions& options, MechanismDef& def,
                           int spare) {
  std::vector<int> driven;
  for (int i = 0; i < options.couplings && spare > 2; ++i) {
    CouplingDef c;
    c.name = "coupling" + std::to_string(i + 1);
    c.a = RandomFreedom(random, def);
    c.b = RandomFreedom(random, def);
    // Nothing is driven twice or drives what drives it.
    const int a = FlatIndex(c.a), b = FlatIndex(c.b);
    if (a == b || std::count(driven.begin(), driven.end(), a) || std::count(driven.begin(), driven.end(), b))
      continue;
    driven.push_back(a);
    driven.push_back(b);
    c.polynomial[1] = random.Uniform(-1, 1);
    for (int k = 2; k < 5; ++k) c.polynomial[k] = random.Uniform(-0.3, 0.3);
    for (int k = 0; k < options.coupling_terms; ++k) {
      const FreedomRef term = RandomFreedom(random, def);
      if (std::count(driven.begin(), driven.end(), FlatIndex(term))) continue;
      driven.push_back(FlatIndex(term));
      c.terms.emplace_back(term, random.Uniform(-1, 1));
    }
    def.couplings.push_back(c);
    --spare;
  }
  for (int i = 0; i < options.springs; ++i) {
    SpringDef s;
    s.name = "tendon" + std::to_string(i + 1);
    for (int k = 2 + random.Below(3); k > 0; --k)
      s.terms.emplace_back(RandomFreedom(random, def), random.Uniform(-1, 1));
    s.stiffness = random.Uniform(options.stiffness_low, options.stiffness_high);
    s.damping = s.stiffness * options.damping_ratio;
    if (options.rest) s.rest = random.Uniform(-0.2, 0.2);
    if (options.bent_springs)  // k₂² < 3 k k₃: they stiffen or soften, and always hold
      s.higher_stiffness = {s.stiffness * random.Uniform(-0.5, 0.5), s.stiffness * random.Uniform(0.1, 3)};
    if (options.slack > 0) s.slack = random.Uniform(0, options.slack);
    def.springs.push_back(s);
  }
  for (int i = 0; i < options.controls; ++i) {
    ControlDef c;
    c.name = "control" + std::to_string(i + 1);
    c.terms.emplace_back(RandomFreedom(random, def), random.Uniform(0.5, 2));
    if (random.Chance(0.3)) c.terms.emplace_back(RandomFreedom(random, def), random.Uniform(-1, 1));
    c.gain = random.Uniform(1, 50);
    c.is_setpoint = random.Chance(0.5);
    def.controls.push_back(c);
  }
  for (int i = 0; i < options.bounded_servos; ++i) {
    ControlDef c;
    c.name = "servo" + std::to_string(i + 1);
    c.terms.emplace_back(RandomFreedom(random, def), random.Uniform(0.5, 2));
    if (random.Chance(0.3)) c.terms.emplace_back(RandomFreedom(random, def), random.Uniform(-1, 1));
    c.gain = random.Uniform(20, 100);
    c.is_setpoint = true;
    SpringDef s;
    s.name = c.name;
    s.terms = c.terms;
    s.stiffness = c.gain;
    s.damping = random.Chance(0.5) ? 0.02 * c.gain : 0;
    s.rest = random.Uniform(-0.1, 0.1);
    ForceLimitDef bound;
    bound.name = c.name;
    bound.terms = c.terms;
    bound.inputs.emplace_back(c.name, 1.0);
    bound.stiffness = s.stiffness;
    bound.damping = s.damping;
    bound.rest = s.rest;
    bound.upper = random.Uniform(2, 10);
    bound.lower = -bound.upper;
    def.controls.push_back(c);
    def.springs.push_back(s);
    def.force_limits.push_back(bound);
  }
}

}  // namespace internal

inline Mechanism BuildOrThrow(const MechanismDef& def) {
  Expected<Mechanism> m = BuildMechanism(def);
  if (!m) throw std::runtime_error(m.error().Text());
  return std::move(*m);
}

/// A random tree of about 0.2 m between bodies, then what the options add to it. Closures and couplings that
/// do not fit (too few freedoms would be left) are left out, so there may be fewer than asked for.
inline MechanismDef RandomMechanismDef(unsigned seed, const RandomMechanismOptions& options = {}) {
  RandomSource random(seed);
  MechanismBuilder builder("random" + std::to_string(seed), options.base, random.Inertia());
  builder.SetBasePose(random.Pose(0.5));
  std::vector<JointDef> joints;
  std::vector<bool> leaf = {false};
  for (int i = 1; i <= options.bodies; ++i) {
    BodyDef body;
    body.name = "body" + std::to_string(i);
    body.parent = BodyIndex(random.Chance(options.chain) ? i - 1 : random.Below(i));
    body.X_PB = random.Pose(0.2);
    body.inertia = random.Inertia();
    leaf[body.parent.u()] = false;
    leaf.push_back(true);
    const BodyIndex b = builder.AddBody(std::move(body));
    // One joint mostly; now and then none, two that stack, or the two hinges of a universal joint.
    const int kind = options.hinges_only || i == 1 ? 0 : random.Below(10);
    const std::string name = "joint" + std::to_string(i);
    if (kind == 9) {
      auto pair = UniversalJoint(name, b, random.Direction(), random.Direction(), random.InBox(0.1));
      joints.push_back(std::move(pair.first));
      joints.push_back(std::move(pair.second));
    } else if (kind != 8) {
      joints.push_back(internal::RandomJoint(random, name, b, options.hinges_only));
      if (kind == 7) {
        JointDef second = internal::RandomJoint(random, name + "b", b, false);
        if (internal::Independent(joints.back(), second)) joints.push_back(std::move(second));
      }
    }
  }
  for (JointDef& joint : joints) {
    const bool sprung = !random.Chance(options.unsprung);
    for (FreedomDef& f : joint.freedoms) {
      if (sprung) f.stiffness = random.Uniform(options.stiffness_low, options.stiffness_high);
      f.damping = options.damping_ratio * random.Uniform(0.2, 1) *
                  (sprung ? f.stiffness : 0.1 * options.stiffness_low);
      if (options.armature && random.Chance(0.5)) f.armature = random.Uniform(0, 0.05);
      if (options.rest) f.rest = random.Uniform(-0.2, 0.2);
    }
  }
  if (!options.joints_in_order) {
    // Joints of one body compose in the order in which they come, so they stay in it.
    std::vector<double> key(leaf.size());
    for (double& k : key) k = random.Uniform(0, 1);
    std::stable_sort(joints.begin(), joints.end(),
                     [&](const JointDef& a, const JointDef& b) { return key[a.body.u()] < key[b.body.u()]; });
  }
  for (JointDef& joint : joints) builder.AddJoint(std::move(joint));
  std::vector<std::string> names;
  for (std::size_t i = leaf.size(); i-- > 1 && static_cast<int>(names.size()) < options.interfaces;)
    if (leaf[i]) names.push_back(builder.definition().bodies[i].name);
  builder.SetInterfaces(names);

  MechanismDef def = builder.definition();
  const Mechanism tree = BuildOrThrow(def);
  int spare = tree.num_coordinates();
  internal::AddRigidClosures(random, options.rigid_closures, tree, def, spare);
  internal::AddSpringyClosures(random, options, tree, def);
  internal::AddConnections(random, options, def, spare);
  return def;
}

inline Mechanism RandomMechanism(unsigned seed, const RandomMechanismOptions& options = {}) {
  return BuildOrThrow(RandomMechanismDef(seed, options));
}

/// Displacements up to `half` [rad, m]; joints need not respect closures. See CloseLoops for that.
inline VectorX RandomCoordinates(const Mechanism& mechanism, unsigned seed, double half = 0.5) {
  RandomSource random(seed ^ 0x5bd1e995u);
  return random.Vector(mechanism.num_coordinates(), half);
}

/// ∂ν/∂q̇ (n x n) from the definition alone: W⁻¹ J_r(W θ) W for joints with three rotations about axes W, else 1.
inline MatrixX JointVelocityMap(const Mechanism& mechanism, const VectorX& q) {
  MatrixX map = MatrixX::Identity(q.size(), q.size());
  for (int j = 0; j < mechanism.num_joints(); ++j) {
    const auto& freedoms = mechanism.definition().joints[static_cast<std::size_t>(j)].freedoms;
    std::vector<int> at;
    Matrix3X axes(3, 0);
    for (std::size_t i = 0; i < freedoms.size(); ++i) {
      const Vector3 axis = freedoms[i].screw_B.head<3>();
      if (axis.isZero(0)) continue;
      at.push_back(mechanism.joint(JointIndex(j)).offset + static_cast<int>(i));
      axes.conservativeResize(3, axes.cols() + 1);
      axes.rightCols<1>() = axis;
    }
    if (at.size() != 3) continue;
    const Matrix3 W = axes;
    map(at, at) = W.inverse() * DexpRotation(-(W * q(at))) * W;
  }
  return map;
}

}  // namespace fork1s::testing
