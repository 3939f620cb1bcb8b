#include <algorithm>
#include <cmath>
#include <fork1s/mechanism/mechanism.hpp>
#include <numeric>
#include <optional>

#include <fmt/format.h>

#include "check_definition.hpp"
#include "freedoms.hpp"
#include "linalg/products.hpp"
#include "linalg/rank.hpp"
#include "linalg/spectrum.hpp"
#include "paths.hpp"

namespace fork1s {
namespace {

using internal::FindControl;
using internal::Named;
using internal::Refuse;

// Joints nearer the root first; everything that names a joint by index follows.
void SortJoints(MechanismDef& def) {
  std::vector<int> order(def.joints.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) {
    return def.joints[static_cast<std::size_t>(a)].body < def.joints[static_cast<std::size_t>(b)].body;
  });
  std::vector<int> position(order.size());
  std::vector<JointDef> sorted;
  for (std::size_t i = 0; i < order.size(); ++i) {
    position[static_cast<std::size_t>(order[i])] = static_cast<int>(i);
    sorted.push_back(std::move(def.joints[static_cast<std::size_t>(order[i])]));
  }
  def.joints = std::move(sorted);
  auto move = [&](FreedomRef& ref) {
    if (ref.joint.valid()) ref.joint = JointIndex(position[ref.joint.u()]);
  };
  for (auto& c : def.couplings) {
    move(c.a), move(c.b);
    for (auto& t : c.terms) move(t.first);
  }
  for (auto& s : def.springs)
    for (auto& t : s.terms) move(t.first);
  for (auto& c : def.controls)
    for (auto& t : c.terms) move(t.first);
  for (auto& f : def.frictions)
    for (auto& t : f.terms) move(t.first);
  for (auto& f : def.force_limits)
    for (auto& t : f.terms) move(t.first);
  for (auto& l : def.length_limits)
    for (auto& t : l.terms) move(t.first);
  for (auto& muscle : def.muscles)
    for (auto& t : muscle.terms) move(t.first);
}

// Smallest eigenvalue of SᵀIS + diag(armature), each freedom scaled by the size of the terms that it sums, so
// that rounding is 1e-16 whatever the units.
double RelativeInertia(const Matrix6& I, const Matrix6X& S, const VectorX& armature) {
  const VectorX size = (S.cwiseAbs().transpose() * I.cwiseAbs() * S.cwiseAbs()).diagonal() + armature;
  if (!(size.minCoeff() > 0)) return 0;
  const VectorX scale = size.cwiseSqrt().cwiseInverse();
  MatrixX block = Congruence(I, S);
  block.diagonal() += armature;
  block = ScaledColumns(ScaledRows(scale, block), scale);
  return EigenvaluesOf(block)(0);
}

// Whatever moves must resist being moved, or its acceleration has no answer. Inertias are gathered in body
// frames, where a point mass on an axis gives zero and not the rounding of its distance from the root.
Expected<void> CheckInertia(const Mechanism& m) {
  constexpr double kRounding = 1e-13;
  const MechanismDef& def = m.definition();
  std::vector<Matrix6> composite;
  for (const BodyDef& b : def.bodies) composite.push_back(b.inertia.Matrix());
  for (std::size_t b = def.bodies.size(); b-- > 1;) {
    const Matrix6 Ad = Adjoint(def.bodies[b].X_PB.inverse());
    composite[def.bodies[b].parent.u()] += Ad.transpose() * composite[b] * Ad;
  }
  for (std::size_t j = 0; j < def.joints.size(); ++j) {
    const JointDef& joint = def.joints[j];
    const auto n = static_cast<Eigen::Index>(joint.freedoms.size());
    Matrix6X S(6, n);
    for (Eigen::Index i = 0; i < n; ++i) S.col(i) = joint.freedoms[static_cast<std::size_t>(i)].screw_B;
    const VectorX armature = m.armature().segment(m.joint(JointIndex(j)).offset, n);
    if (!(RelativeInertia(composite[joint.body.u()], S, armature) > kRounding))
      return Refuse(Named("joint", joint.name),
                    fmt::format("moves body '{}' and what hangs on it, which have no inertia about it; "
                                "give mass and inertia, or armature",
                                m.body(joint.body).name));
  }
  if (def.base == BaseKind::kFloating &&
      !(RelativeInertia(composite[0], Matrix6X::Identity(6, 6), VectorX::Zero(6)) > kRounding))
    return Refuse(Named("mechanism", def.name),
                  "floats but has no mass, or no rotational inertia about some axis");
  return {};
}

// Where all bodies have one origin: the longest distance that joints and closures tell, so that it follows the
// unit of length; 1 where they have none, and nothing hangs on it.
double FallbackLength(const MechanismDef& def) {
  double length = 0;
  for (const JointDef& j : def.joints)
    for (const FreedomDef& f : j.freedoms)
      if (const double turn = f.screw_B.head<3>().norm(); turn > 0)
        length = std::max(length, f.screw_B.tail<3>().norm() / turn);
  for (const ClosureDef& c : def.closures)
    length = std::max({length, c.X_AJ.translation().norm(), c.X_BJ.translation().norm()});
  return length > 0 ? length : 1;
}

// The rotation vector of a joint with three rotations about independent axes.
std::optional<Mechanism::Rotation> FindRotation(const Matrix6X& screws, const Mechanism::Joint& joint,
                                                JointIndex index) {
  Mechanism::Rotation rotation;
  rotation.joint = index;
  std::size_t count = 0;
  for (int i = joint.offset; i < joint.offset + joint.size; ++i) {
    if (screws.col(i).head<3>().isZero(0)) continue;
    if (count == 3) return std::nullopt;
    rotation.coordinates[count] = i;
    rotation.axes.col(static_cast<Eigen::Index>(count++)) = screws.col(i).head<3>();
  }
  if (count < 3 || DecideRank(SingularValues(rotation.axes.colwise().normalized())).value < 3)
    return std::nullopt;
  rotation.axes_inverse = rotation.axes.inverse();
  return rotation;
}

}  // namespace

std::vector<std::pair<int, int>> Mechanism::FilteredContacts() const {
  std::vector<std::pair<int, int>> pairs;
  const auto add = [&](int joint_a, int joint_b) {
    if (joint_a != joint_b) pairs.emplace_back(joint_a, joint_b);
  };
  for (const Body& b : bodies_) {
    if (!b.parent.valid()) continue;
    const int above = body(b.parent).last_joint;
    if (definition_.FiltersParent(above < 0)) add(above, b.last_joint);
  }
  for (const ClosureDef& c : closures()) add(body(c.body_a).last_joint, body(c.body_b).last_joint);
  return pairs;
}

std::string Mechanism::CoordinateName(int i) const {
  const Joint& j = joint(CoordinateJoint(i));
  return internal::CoordinateName(j.name, j.size, i - j.offset);
}

Expected<Mechanism> BuildMechanism(MechanismDef definition) {
  if (auto ok = internal::CheckDefinition(definition); !ok) return tl::unexpected(ok.error());
  SortJoints(definition);

  Mechanism m;
  m.definition_ = std::move(definition);
  const MechanismDef& def = m.definition_;

  double length = 0;
  int lengths = 0;
  for (const BodyDef& b : def.bodies) {
    Mechanism::Body body;
    body.name = b.name;
    body.parent = b.parent;
    body.X_RB0 = b.parent.valid() ? m.bodies_[b.parent.u()].X_RB0 * b.X_PB : RigidTransform::Identity();
    body.X_RB0.Orthonormalize();
    body.inertia_B = b.inertia;
    body.inertia_R0 = Transform(body.X_RB0, b.inertia);
    body.weighed_mass = b.inertia.mass * (1 - b.gravity_compensation);
    m.total_mass_ += b.inertia.mass;
    m.weighed_mass_ += body.weighed_mass;
    if (b.parent.valid() && b.X_PB.translation().norm() > 0) {
      length += b.X_PB.translation().norm();
      ++lengths;
    }
    m.bodies_.push_back(std::move(body));
  }
  m.length_scale_ = lengths > 0 ? length / lengths : FallbackLength(def);

  int n = 0;
  for (const JointDef& j : def.joints) n += static_cast<int>(j.freedoms.size());
  m.screws_.resize(6, n);
  for (VectorX* v : {&m.stiffness_, &m.damping_, &m.armature_, &m.rest_, &m.lower_, &m.upper_}) v->resize(n);

  // Joints come sorted by body, bodies by depth, so one sweep links every joint to the one before it.
  std::size_t next = 0;
  int offset = 0;
  for (std::size_t b = 0; b < m.bodies_.size(); ++b) {
    Mechanism::Body& body = m.bodies_[b];
    int last = body.parent.valid() ? m.bodies_[body.parent.u()].last_joint : -1;
    for (; next < def.joints.size() && def.joints[next].body.u() == b; ++next) {
      const JointDef& j = def.joints[next];
      Mechanism::Joint joint{j.name, j.kind, j.body, last, offset, static_cast<int>(j.freedoms.size())};
      for (const FreedomDef& f : j.freedoms) {
        m.screws_.col(offset) = AdjointApply(body.X_RB0, f.screw_B);
        m.screw_motions_.emplace_back(m.screws_.col(offset));
        m.stiffness_(offset) = f.stiffness;
        m.damping_(offset) = f.damping;
        m.armature_(offset) = f.armature;
        m.rest_(offset) = f.rest;
        m.lower_(offset) = f.lower;
        m.upper_(offset) = f.upper;
        m.coordinate_joint_.push_back(static_cast<int>(next));
        ++offset;
      }
      last = static_cast<int>(next);
      if (const auto rotation = FindRotation(m.screws_, joint, JointIndex(next))) {
        joint.rotation = static_cast<int>(m.rotations_.size());
        m.rotations_.push_back(*rotation);
      }
      m.joints_.push_back(std::move(joint));
    }
    body.last_joint = last;
  }

  auto coordinate = [&](const FreedomRef& ref) { return m.joints_[ref.joint.u()].offset + ref.freedom; };
  for (const PathDef& p : def.paths) {
    Mechanism::Path path;
    path.name = p.name;
    path.elements = p.elements;
    path.kind = p.kind;
    path.rod = p.rod;
    path.gear = p.gear;
    internal::FindCoordinates(m, static_cast<int>(m.paths_.size()), path);
    m.paths_.push_back(std::move(path));
  }
  if (!m.paths_.empty()) {
    Kinematics reference(m);
    ComputeKinematics(m, VectorX::Zero(n), reference);
    for (std::size_t i = 0; i < m.paths_.size(); ++i) m.paths_[i].at_reference = reference.paths[i].length;
  }
  auto form_of = [&](const auto& d) {
    Mechanism::Length form;
    for (const auto& [ref, c] : d.terms) form.terms.emplace_back(coordinate(ref), c);
    form.path = d.along.path;
    form.gear = form.path < 0 ? 0 : d.along.gear;
    return form;
  };
  // Motors, dampers and dry friction of rotations act on the angular velocity: a path takes the place of their terms.
  // Servos act on θ as springs do.
  const auto rotates = [&](const std::pair<int, double>& term) {
    const int rotation = m.joint(m.CoordinateJoint(term.first)).rotation;
    if (rotation < 0) return false;
    const auto& of = m.rotations_[static_cast<std::size_t>(rotation)].coordinates;
    return std::find(of.begin(), of.end(), term.first) != of.end();
  };
  std::string both;  // name of a length that has a path and rotations
  auto rate_form_of = [&](const auto& d) {
    Mechanism::Length form = form_of(d);
    const auto first = std::stable_partition(form.terms.begin(), form.terms.end(),
                                             [&](const auto& term) { return !rotates(term); });
    if (first == form.terms.end()) return form;
    if (form.path >= 0) both = d.name;
    Mechanism::Path path;
    path.name = d.name;
    path.rates.assign(first, form.terms.end());
    form.terms.erase(first, form.terms.end());
    internal::FindRateCoordinates(m, path);
    form.path = static_cast<int>(m.paths_.size());
    form.gear = 1;
    m.paths_.push_back(std::move(path));
    return form;
  };
  for (const SpringDef& s : def.springs)
    m.springs_.push_back(
        {s.name, form_of(s), s.stiffness, s.damping, s.rest, s.higher_stiffness, s.higher_damping, s.slack});
  // The spring of a rotation acts on θ, its damper on ω. A servo with force bounds is one force along θ,
  // damper included: along ω, a bound on their sum would leave a force that does not dissipate.
  const auto is_bounded_servo = [&](const SpringDef& spring) {
    const auto form = form_of(spring).terms;
    return std::any_of(def.force_limits.begin(), def.force_limits.end(), [&](const ForceLimitDef& limit) {
      return limit.stiffness > 0 && limit.damping > 0 && form_of(limit).terms == form;
    });
  };
  for (std::size_t i = 0; i < def.springs.size(); ++i) {
    Mechanism::Spring& spring = m.springs_[i];
    const std::array<double, 2> none = {};
    if (std::none_of(spring.length.terms.begin(), spring.length.terms.end(), rotates) ||
        (spring.damping == 0 && spring.higher_damping == none) || is_bounded_servo(def.springs[i]))
      continue;
    Mechanism::Spring damper{spring.name, rate_form_of(def.springs[i]), 0, spring.damping, 0,
                             none,        spring.higher_damping,        0};
    spring.damping = 0;
    spring.higher_damping = none;
    m.springs_.push_back(std::move(damper));
  }
  for (const ControlDef& c : def.controls)
    m.controls_.push_back(
        {c.name, c.is_setpoint ? form_of(c) : rate_form_of(c), c.gain, c.lower, c.upper, c.initial});
  for (const MuscleDef& muscle : def.muscles) {
    const Mechanism::Length along = rate_form_of(muscle);
    const double optimum =
        (muscle.length_upper - muscle.length_lower) / (muscle.range_upper - muscle.range_lower);
    const double zero = muscle.length_lower - muscle.range_lower * optimum;
    m.muscles_.push_back({muscle.name, along, FindControl(def, muscle.control), muscle.force, optimum, zero,
                          muscle.lmin, muscle.lmax, muscle.vmax, muscle.fvmax});
    // F_P: x²/2 for 0 < x <= 1 and x - 1/2 beyond, times fpmax, with x = (L - 1)/((lmax - 1)/2).
    Mechanism::Spring passive{muscle.name, along, 0, 0, zero + optimum};
    passive.toe = 0.5 * (muscle.lmax - 1) * optimum;
    passive.stiffness = muscle.force * muscle.fpmax / passive.toe;
    m.springs_.push_back(std::move(passive));
  }
  for (const DryFrictionDef& f : def.frictions) m.frictions_.push_back({f.name, rate_form_of(f), f.force});
  for (int i = 0; i < n; ++i)
    if (std::isfinite(m.lower_(i)) || std::isfinite(m.upper_(i)))
      m.length_limits_.push_back({m.CoordinateName(i), {{{i, 1.0}}}, m.lower_(i), m.upper_(i), true});
  for (const LengthLimitDef& l : def.length_limits)
    m.length_limits_.push_back(
        {l.name, form_of(l), l.lower, l.upper,
         l.along.path >= 0 && m.paths_[static_cast<std::size_t>(l.along.path)].kind == PathKind::kAngle});
  for (const ForceLimitDef& f : def.force_limits) {
    Mechanism::LinearForm inputs;
    for (const auto& [name, share] : f.inputs) {
      const int control = FindControl(def, name);
      inputs.emplace_back(control, share * def.controls[static_cast<std::size_t>(control)].gain);
    }
    m.force_limits_.push_back({f.name, f.stiffness > 0 ? form_of(f) : rate_form_of(f), std::move(inputs),
                               f.stiffness, f.damping, f.rest, f.lower, f.upper});
  }
  if (!both.empty())
    return Refuse(Named("length", both),
                  "acts along a path and on a rotation vector at once; give one of each");
  for (const CouplingDef& c : def.couplings) {
    Mechanism::Coupling coupling;
    coupling.name = c.name;
    coupling.a = coordinate(c.a);
    coupling.b = c.b.joint.valid() ? coordinate(c.b) : -1;
    std::copy(std::begin(c.polynomial), std::end(c.polynomial), coupling.polynomial);
    for (const auto& [ref, coefficient] : c.terms) coupling.terms.emplace_back(coordinate(ref), coefficient);
    m.couplings_.push_back(std::move(coupling));
  }
  for (const ClosureDef& c : def.closures) {
    m.num_constraints_ += static_cast<int>(c.rigid.count());
    m.num_springy_rows_ += static_cast<int>(((!c.rigid.array()) && (c.stiffness.array() > 0)).count());
  }
  m.num_constraints_ += static_cast<int>(m.couplings_.size());

  if (auto ok = CheckInertia(m); !ok) return tl::unexpected(ok.error());
  return m;
}

}  // namespace fork1s
