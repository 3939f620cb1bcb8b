#include "check_definition.hpp"

#include <algorithm>
#include <cmath>
#include <fork1s/mechanism/mechanism.hpp>
#include <set>
#include <unordered_set>

#include <fmt/format.h>

#include "linalg/rank.hpp"
#include "paths.hpp"

namespace fork1s::internal {

tl::unexpected<Error> Refuse(std::string where, std::string message) {
  return Fail(ErrorCode::kModel, std::move(where), std::move(message));
}

std::string Named(const char* kind, const std::string& name) { return fmt::format("{} '{}'", kind, name); }

int FindControl(const MechanismDef& def, const std::string& name) {
  for (std::size_t i = 0; i < def.controls.size(); ++i)
    if (def.controls[i].name == name) return static_cast<int>(i);
  return -1;
}

namespace {

Expected<void> CheckPose(const RigidTransform& X, const std::string& where, const char* what) {
  if (!X.IsFinite()) return Refuse(where, fmt::format("has a {} that is not finite", what));
  const Matrix3& R = X.rotation();
  // Matrices typed with four digits pass; reflections, scalings and transposed nonsense do not.
  if ((R * R.transpose() - Matrix3::Identity()).norm() > 1e-3 || R.determinant() < 0)
    return Refuse(where, fmt::format("has a {} whose rotation matrix is not a rotation", what));
  return {};
}

Expected<void> CheckBodies(const MechanismDef& def) {
  if (def.bodies.empty()) return Refuse(Named("mechanism", def.name), "has no bodies; add a base first");
  if (auto ok = CheckPose(def.X_WR, Named("mechanism", def.name), "base pose"); !ok) return ok;
  std::unordered_set<std::string> names;
  for (std::size_t i = 0; i < def.bodies.size(); ++i) {
    const BodyDef& b = def.bodies[i];
    const std::string where = Named("body", b.name);
    if (!names.insert(b.name).second)
      return Refuse(where, "this name is used twice; body names must differ within a mechanism");
    if (i == 0 && b.parent.valid()) return Refuse(where, "is the base and must not have a parent");
    if (i > 0 && (!b.parent.valid() || b.parent.u() >= i))
      return Refuse(where, "needs a parent that comes before it");
    if (auto ok = CheckPose(b.X_PB, where, "pose"); !ok) return ok;
    const SpatialInertia& I = b.inertia;
    if (!std::isfinite(I.mass) || !I.center.allFinite() || !I.rotational.allFinite())
      return Refuse(where, "has a mass or inertia that is not finite; give finite numbers");
    if (!std::isfinite(b.gravity_compensation))
      return Refuse(where, "has a gravity compensation that is not finite; give a share such as 0 or 1");
    if (I.mass < 0)
      return Refuse(where, fmt::format("has negative mass {} kg; masses must be 0 or more", I.mass));
    if ((I.rotational - I.rotational.transpose()).norm() > 1e-6 * I.rotational.norm())
      return Refuse(where, "has a rotational inertia that is not symmetric");
    const double smallest = PrincipalValues(I.rotational)(0);
    if (smallest < -1e-9 * std::max(1e-12, I.rotational.norm()))
      return Refuse(where,
                    fmt::format("has a rotational inertia with the negative principal moment {} kg·m²; "
                                "principal moments must be 0 or more",
                                smallest));
  }
  return {};
}

// Screws of one joint [ω; v / distance of their axes], each of length 1.
MatrixX InOneUnit(Matrix6X S) {
  double distance = 0;
  for (Eigen::Index i = 0; i < S.cols(); ++i)
    if (const double turn = S.col(i).head<3>().norm(); turn > 0)
      distance = std::max(distance, S.col(i).tail<3>().norm() / turn);
  if (distance > 0) S.bottomRows<3>() /= distance;
  for (Eigen::Index i = 0; i < S.cols(); ++i)
    if (const double size = S.col(i).norm(); size > 0) S.col(i) /= size;
  return S;
}

Expected<void> CheckJoints(const MechanismDef& def) {
  std::unordered_set<std::string> names;
  for (const JointDef& j : def.joints) {
    const std::string where = Named("joint", j.name);
    if (!names.insert(j.name).second)
      return Refuse(where, "this name is used twice; joint names must differ within a mechanism");
    if (!j.body.valid() || j.body.u() >= def.bodies.size())
      return Refuse(where, "moves a body that does not exist");
    if (j.body.value() == 0)
      return Refuse(where, "moves the base; say fixed, floating or driven base instead");
    const auto n = j.freedoms.size();
    if (n < 1 || n > 6) return Refuse(where, fmt::format("has {} freedoms; a joint has 1 to 6", n));
    Matrix6X S(6, static_cast<Eigen::Index>(n));
    for (std::size_t i = 0; i < n; ++i) {
      const FreedomDef& f = j.freedoms[i];
      S.col(static_cast<Eigen::Index>(i)) = f.screw_B;
      if (!f.screw_B.allFinite()) return Refuse(where, "has an axis or anchor that is not finite");
      for (const auto& [value, what] :
           {std::pair{f.stiffness, "stiffness"}, {f.damping, "damping"}, {f.armature, "armature"}}) {
        if (!std::isfinite(value)) return Refuse(where, fmt::format("has a {} that is not finite", what));
        if (value < 0) return Refuse(where, fmt::format("has {} {}; it must be 0 or more", what, value));
      }
      if (!std::isfinite(f.rest)) return Refuse(where, "has a spring reference that is not finite");
      if (!(f.lower <= f.upper))  // NaN too
        return Refuse(where, fmt::format("has limits {} to {}; the lower must not be above the upper",
                                         f.lower, f.upper));
    }
    if (DecideRank(SingularValues(InOneUnit(S))).value < static_cast<int>(n))
      return Refuse(where, "has freedoms that depend on each other, or an axis of length zero");
  }
  return {};
}

Expected<void> CheckRef(const MechanismDef& def, const FreedomRef& ref, const std::string& where) {
  if (!ref.joint.valid() || ref.joint.u() >= def.joints.size())
    return Refuse(where, "names a joint that does not exist");
  if (ref.freedom < 0 || ref.freedom >= static_cast<int>(def.joints[ref.joint.u()].freedoms.size()))
    return Refuse(where, fmt::format("names freedom {} of joint '{}', which has fewer", ref.freedom,
                                     def.joints[ref.joint.u()].name));
  return {};
}

Expected<void> CheckUse(const MechanismDef& def, const PathRef& use, const std::string& where) {
  if (use.path < -1 || use.path >= static_cast<int>(def.paths.size()))
    return Refuse(where, "acts along a path that does not exist");
  if (!std::isfinite(use.gear)) return Refuse(where, "acts along a path with a gear that is not finite");
  return {};
}

// Terms and path of whatever acts on a length.
template <class Def>
Expected<void> CheckLength(const MechanismDef& def, const Def& d, const std::string& where) {
  for (const auto& [ref, coefficient] : d.terms) {
    if (auto ok = CheckRef(def, ref, where); !ok) return ok;
    if (!std::isfinite(coefficient)) return Refuse(where, "has a coefficient that is not finite");
  }
  return CheckUse(def, d.along, where);
}

Expected<void> CheckBoundedForces(const MechanismDef& def) {
  for (const DryFrictionDef& f : def.frictions) {
    const std::string where = Named("dry friction", f.name);
    if (auto ok = CheckLength(def, f, where); !ok) return ok;
    if (!std::isfinite(f.force) || f.force < 0)
      return Refuse(where, fmt::format("has the force {}; it must be finite and 0 or more", f.force));
  }
  for (const LengthLimitDef& l : def.length_limits) {
    const std::string where = Named("length limit", l.name);
    if (auto ok = CheckLength(def, l, where); !ok) return ok;
    if (!(l.lower <= l.upper))
      return Refuse(where, fmt::format("reaches from {} to {}; the lower must not be above the upper",
                                       l.lower, l.upper));
  }
  for (const ForceLimitDef& f : def.force_limits) {
    const std::string where = Named("force limit", f.name);
    if (auto ok = CheckLength(def, f, where); !ok) return ok;
    for (const auto& [name, share] : f.inputs)
      if (FindControl(def, name) < 0 || !std::isfinite(share))
        return Refuse(
            where,
            fmt::format("names the control '{}', which is not there, or a share that is not finite", name));
    if (!std::isfinite(f.stiffness) || !std::isfinite(f.damping) || !std::isfinite(f.rest) ||
        f.stiffness < 0 || f.damping < 0)
      return Refuse(where, "has a stiffness, damping or rest length that is negative or not finite");
    if (!(f.lower <= f.upper))
      return Refuse(
          where, fmt::format("has bounds {} to {}; the lower must not be above the upper", f.lower, f.upper));
  }
  return {};
}

Expected<void> CheckDynamics(const ControlDef& c, const std::string& where) {
  if (c.dynamics == ControlDynamics::kLag && !(c.time_constant > 0 && std::isfinite(c.time_constant)))
    return Refuse(where,
                  fmt::format("follows its input with the time constant {} s; it must be finite and above 0",
                              c.time_constant));
  // The activation is solved in steps of a part of these.
  constexpr double kShortest = 1e-5;  // s
  if (c.dynamics == ControlDynamics::kMuscle) {
    for (const double time : {c.time_constant, c.deactivation_time})
      if (!(time >= kShortest && std::isfinite(time)))
        return Refuse(where,
                      fmt::format("has the activation time {} s and the deactivation time {} s; both must be "
                                  "finite and {} s or more",
                                  c.time_constant, c.deactivation_time, kShortest));
    if (!(c.smoothing >= 0 && std::isfinite(c.smoothing)))
      return Refuse(where, fmt::format("has the smoothing {}; it must be finite and 0 or more", c.smoothing));
  }
  if (!(c.activation_lower <= c.activation_upper))
    return Refuse(where, fmt::format("has an activation from {} to {}; the lower must not be above the upper",
                                     c.activation_lower, c.activation_upper));
  if (!std::isfinite(c.initial_activation))
    return Refuse(where, "starts at an activation that is not finite");
  return {};
}

Expected<void> CheckAdhesions(const MechanismDef& def) {
  for (const AdhesionDef& a : def.adhesions) {
    const std::string where = Named("adhesion", a.name);
    if (!def.FindBody(a.body).valid())
      return Refuse(where, fmt::format("names the body '{}'; mechanism '{}' has no body of this name", a.body,
                                       def.name));
    if (FindControl(def, a.control) < 0)
      return Refuse(where, fmt::format("names the control '{}', which is not there; add it", a.control));
    if (!std::isfinite(a.gain))
      return Refuse(where, "has a gain that is not finite; give it in N per unit of its control");
    if (!(a.lower <= a.upper))
      return Refuse(where, fmt::format("has bounds {} to {} N; the lower must not be above the upper",
                                       a.lower, a.upper));
  }
  return {};
}

Expected<void> CheckSwitchedClosures(const MechanismDef& def) {
  for (const SwitchedClosureDef& s : def.switched_closures) {
    const std::string where = Named("switched closure", s.name);
    if (!def.FindBody(s.body_a).valid())
      return Refuse(where, fmt::format("names the body '{}'; mechanism '{}' has no body of this name",
                                       s.body_a, def.name));
    if (FindControl(def, s.control) < 0)
      return Refuse(where, fmt::format("names the control '{}', which is not there; add it", s.control));
    if (!s.X_AJ.IsFinite() || !s.X_BJ.IsFinite()) return Refuse(where, "has a frame that is not finite");
    if (!(s.time_constant > 0) || !std::isfinite(s.time_constant))
      return Refuse(where, fmt::format("has a time constant of {} s; give one above 0", s.time_constant));
    if (s.rigid[0] != s.rigid[1] || (s.rigid[2] && !s.rigid[0]))
      return Refuse(where,
                    "holds some rotations alone; hold all, all but that about z of its frame, or none");
    if (!s.rigid.any()) return Refuse(where, "holds no direction; mark those that it holds as rigid");
  }
  return {};
}

Expected<void> CheckMuscles(const MechanismDef& def) {
  for (const MuscleDef& m : def.muscles) {
    const std::string where = Named("muscle", m.name);
    if (auto ok = CheckLength(def, m, where); !ok) return ok;
    if (FindControl(def, m.control) < 0)
      return Refuse(where, fmt::format("names the control '{}', which is not there", m.control));
    if (!(m.force >= 0 && std::isfinite(m.force)))
      return Refuse(where, fmt::format("has the force {} N; it must be finite and 0 or more", m.force));
    if (!(m.length_lower < m.length_upper && std::isfinite(m.length_upper - m.length_lower)))
      return Refuse(
          where, fmt::format("has the length range {} to {}; both must be finite, the lower below the upper",
                             m.length_lower, m.length_upper));
    if (!(m.range_lower < m.range_upper && std::isfinite(m.range_upper - m.range_lower)))
      return Refuse(
          where, fmt::format("has the range {} to {} of normalized lengths; both must be finite, the lower "
                             "below the upper",
                             m.range_lower, m.range_upper));
    if (!(m.lmin < 1 && m.lmax > 1 && std::isfinite(m.lmax - m.lmin)))
      return Refuse(where, fmt::format("has lmin {} and lmax {}; they must be finite, below and above 1",
                                       m.lmin, m.lmax));
    if (!(m.vmax > 0 && m.fpmax >= 0 && m.fvmax >= 1 && std::isfinite(m.vmax + m.fpmax + m.fvmax)))
      return Refuse(
          where,
          fmt::format("has vmax {}, fpmax {} and fvmax {}; they must be finite, above 0, 0 or more, and "
                      "1 or more",
                      m.vmax, m.fpmax, m.fvmax));
  }
  return {};
}

Expected<void> CheckConnections(const MechanismDef& def) {
  for (const ClosureDef& c : def.closures) {
    const std::string where = Named("closure", c.name);
    for (BodyIndex b : {c.body_a, c.body_b})
      if (!b.valid() || b.u() >= def.bodies.size()) return Refuse(where, "joins a body that does not exist");
    if (c.body_a == c.body_b) return Refuse(where, "joins a body to itself");
    if (auto ok = CheckPose(c.X_AJ, where, "frame"); !ok) return ok;
    if (auto ok = CheckPose(c.X_BJ, where, "frame"); !ok) return ok;
    if (!c.stiffness.allFinite() || !c.damping.allFinite() || (c.stiffness.array() < 0).any() ||
        (c.damping.array() < 0).any())
      return Refuse(where, "has a stiffness or damping that is negative or not finite");
  }
  for (const CouplingDef& c : def.couplings) {
    const std::string where = Named("coupling", c.name);
    std::vector<FreedomRef> all = {c.a};
    if (c.b.joint.valid()) all.push_back(c.b);
    bool finite = std::all_of(std::begin(c.polynomial), std::end(c.polynomial),
                              [](double p) { return std::isfinite(p); });
    for (const auto& [ref, coefficient] : c.terms) {
      all.push_back(ref);
      finite = finite && std::isfinite(coefficient);
    }
    if (!finite) return Refuse(where, "has a coefficient that is not finite");
    std::set<std::pair<int, int>> before;
    for (const FreedomRef& ref : all) {
      if (auto ok = CheckRef(def, ref, where); !ok) return ok;
      if (!before.emplace(ref.joint.value(), ref.freedom).second)
        return Refuse(where, fmt::format("couples joint '{}' to itself; name each joint once",
                                         def.joints[ref.joint.u()].name));
    }
  }
  for (const PathDef& p : def.paths)
    if (auto ok = internal::CheckPath(def, p); !ok) return ok;
  for (const SpringDef& s : def.springs) {
    const std::string where = Named("spring", s.name);
    if (auto ok = CheckLength(def, s, where); !ok) return ok;
    if (!std::isfinite(s.stiffness) || !std::isfinite(s.damping) || !std::isfinite(s.rest) ||
        s.stiffness < 0 || s.damping < 0)
      return Refuse(where, "has a stiffness, damping or rest length that is negative or not finite");
    if (!std::isfinite(s.slack) || s.slack < 0)
      return Refuse(where, fmt::format("is slack over {}; it must be finite and 0 or more", s.slack));
    for (const auto& higher : {s.higher_stiffness, s.higher_damping})
      for (const double term : higher)
        if (!std::isfinite(term))
          return Refuse(where, "has a higher term of stiffness or damping that is not finite");
  }
  for (const ControlDef& c : def.controls) {
    const std::string where = Named("control", c.name);
    if (auto ok = CheckLength(def, c, where); !ok) return ok;
    if (!(c.lower <= c.upper))
      return Refuse(
          where, fmt::format("has limits {} to {}; the lower must not be above the upper", c.lower, c.upper));
    if (!std::isfinite(c.gain + c.initial + c.setpoint_per_unit + c.setpoint_rest))
      return Refuse(where, "has a gain, value or set-point of its spring that is not finite");
    if (auto ok = CheckDynamics(c, where); !ok) return ok;
  }
  if (auto ok = CheckBoundedForces(def); !ok) return ok;
  if (auto ok = CheckMuscles(def); !ok) return ok;
  if (auto ok = CheckAdhesions(def); !ok) return ok;
  if (auto ok = CheckSwitchedClosures(def); !ok) return ok;
  for (const std::string& name : def.interfaces)
    if (!def.FindBody(name).valid())
      return Refuse(Named("interface", name),
                    fmt::format("mechanism '{}' has no body of this name", def.name));
  if (def.modes < 0) return Refuse(Named("mechanism", def.name), "asks for a negative number of modes");
  return {};
}

}  // namespace

Expected<void> CheckDefinition(const MechanismDef& definition) {
  if (auto ok = CheckBodies(definition); !ok) return ok;
  if (auto ok = CheckJoints(definition); !ok) return ok;
  return CheckConnections(definition);
}

}  // namespace fork1s::internal
