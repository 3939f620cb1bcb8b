#include <algorithm>
#include <cmath>
#include <fork1s/stepping/mechanism_dynamics.hpp>
#include <iostream>

#include "random_motion.hpp"

namespace fork1s::random_motion {
namespace {

// Growth of energy by SDIRK2, of the kinetic energy, with steps of 1/60 s and with turns of this angle a step
// [rad]: a four-bar at 6 rad/s gains 7e-4 (docs/decisions/001-time-stepping.md). It falls with the square of
// the step.
constexpr double kEnergyShare = 1e-3, kEnergyStep = 1.0 / 60, kEnergyTurn = 0.1;
constexpr double kLargestHalvings = 64;  // parts of a step: six halvings

struct Momenta {
  Vector3 linear = Vector3::Zero(), angular = Vector3::Zero();  // angular about the centre of mass
  double linear_scale = 0, angular_scale = 0;  // sums of the magnitudes that they are made of
};

Momenta ComputeMomenta(const MechanismDynamics& m) {
  Momenta out;
  const int n = m.mechanism().num_bodies();
  std::vector<Vector3> center(static_cast<std::size_t>(n)), velocity(center.size()), spin(center.size());
  Vector3 moment = Vector3::Zero();
  double mass = 0;
  for (int b = 0; b < n; ++b) {
    const auto at = static_cast<std::size_t>(b);
    const RigidTransform X = m.BodyPose(BodyIndex(b));
    const Vector6 V = m.BodyVelocity(BodyIndex(b));
    const SpatialInertia& I = m.mechanism().body(BodyIndex(b)).inertia_B;
    center[at] = X * I.center;
    velocity[at] = V.tail<3>() + V.head<3>().cross(X.rotation() * I.center);
    spin[at] = X.rotation() * I.rotational * X.rotation().transpose() * V.head<3>();
    moment += I.mass * center[at];
    mass += I.mass;
    out.linear += I.mass * velocity[at];
    out.linear_scale += I.mass * velocity[at].norm();
  }
  const Vector3 middle = moment / mass, mean = out.linear / mass;
  for (int b = 0; b < n; ++b) {
    const auto at = static_cast<std::size_t>(b);
    const double own = m.mechanism().body(BodyIndex(b)).inertia_B.mass;
    out.angular += spin[at] + own * (center[at] - middle).cross(velocity[at] - mean);
    // Also of the whole's own velocity: in free fall without spin nothing else is there.
    out.angular_scale += spin[at].norm() + own * (center[at] - middle).norm() * velocity[at].norm();
  }
  return out;
}

RigidTransform BasePose(const Case& c, int step) {
  Vector6 moved = Vector6::Zero();
  if (c.base_jumps) {
    if (step > c.jump_step) moved = c.base_motion;
  } else {
    moved = c.base_motion * (1 - std::cos(c.base_rate * step * c.step.h));
  }
  return RigidTransform(ExpRotation(moved.head<3>()) * c.mechanism().X_WR.rotation(),
                        c.mechanism().X_WR.translation() + moved.tail<3>());
}

// The first contradiction of a report, or nothing.
std::string FaultOf(const StepReport& r) {
  if (!r.finite && r.stages_converged) return "undone, but stages converged";
  if (!r.finite && r.halving_of.kind == StepSubject::Kind::kNone) return "undone, but of nothing";
  if (r.parts > kLargestHalvings) return std::to_string(r.parts) + " parts";
  if (r.finite && (r.parts > 1) != (r.halving != HalvingCause::kNone)) return "halved, but for no cause";
  if (r.finite && r.impact != (r.halving == HalvingCause::kImpact) && r.parts == 1)
    return "impact in a whole step";
  if (r.halving != HalvingCause::kNone && r.halving_of.kind == StepSubject::Kind::kNone)
    return "halved for nothing";
  if (!std::isfinite(r.stage_residual) || !std::isfinite(r.max_penetration))
    return "figures that are not finite";
  if (r.contacts_dropped) return "contacts dropped";
  return "";
}

// Whether energy is added in the step after which `step` are done.
bool HasInput(const Case& c, int step) {
  return c.push.body >= 0 && step >= c.push.begin && step < c.push.end;
}

}  // namespace

Result Simulate(const Case& c, bool trace) {
  Result out;
  out.seed = c.seed;
  out.description = c.description;
  auto created = World::Create(c.scene, c.world);
  if (!created) {
    out.refusal = created.error().Text();
    return out;
  }
  World world = std::move(*created);
  MechanismDynamics& m = world.mechanisms()[0];
  const int n = m.mechanism().num_bodies();
  const bool driven = c.mechanism().base == BaseKind::kDriven;
  const double h = c.step.h, g = c.step.gravity.norm(),
               floor = c.scene.world.empty() ? 0 : c.scene.world[0].X_BG.translation().z();
  double mass = 0;  // of all that moves
  for (int b = driven || c.mechanism().base == BaseKind::kFixed ? 1 : 0; b < n; ++b)
    mass += m.mechanism().body(BodyIndex(b)).inertia_B.mass;
  double block = 0;
  for (const FreeBody& body : world.free_bodies()) block += body.inertia().mass;

  double kinetic = 0, explained = mass * std::pow(1e-6 * c.size / h, 2), excess = 0, start = 0, lift = 0,
         energy_size = 0;
  Momenta first;
  double linear_scale = 0, angular_scale = 0;
  int since = 0;
  out.has_energy_bound = !driven;
  out.has_momentum = c.mechanism().base == BaseKind::kFloating && !c.has_contact();
  const auto energy = [&] { return world.KineticEnergy() + world.PotentialEnergy(c.step.gravity); };
  for (int i = 0; i < c.steps; ++i) {
    const bool jumps = i == c.jump_step;
    if (jumps) m.controls() = c.set_points;
    if (i == 0 || jumps || HasInput(c, i - 1)) {
      start = energy();
      since = i;
      for (std::size_t k = 0; k < m.mechanism().controls().size(); ++k)
        energy_size +=
            m.mechanism().controls()[k].gain * std::pow(m.controls()(static_cast<Eigen::Index>(k)), 2);
      first = ComputeMomenta(m);
      // What moves and what springs hold, and what weight gives to what falls through the run.
      explained += world.KineticEnergy() + world.PotentialEnergy(Vector3::Zero());
      explained += (mass + block) * g * (0.5 * g * std::pow(c.steps * h, 2) + c.size);
    }
    if (driven) {
      const RigidTransform X = BasePose(c, i + 1);
      const double speed =
          (X.translation() - m.state().X_WR.translation()).norm() / h +
          LogRotation(X.rotation() * m.state().X_WR.rotation().transpose()).norm() / h * 10 * c.size;
      explained += mass * speed * speed;
      m.DriveBase(X);
    }
    if (HasInput(c, i)) {
      const Vector3 at = m.BodyPose(BodyIndex(c.push.body)).translation();
      m.AddWrench(BodyIndex(c.push.body), c.push.force, c.push.moment, at);
    }
    const StepReport report = world.Step(c.step);
    if (out.report_fault.empty())
      if (const std::string fault = FaultOf(report); !fault.empty())
        out.report_fault = fault + " in step " + std::to_string(i);
    if (!report.finite) {
      ++out.undone;
      if (out.undone_of.empty())
        out.undone_of = world.NameOf(report.halving_of) + " in step " + std::to_string(i);
      if (HasInput(c, i)) out.has_momentum = false;
    }
    out.unconverged += report.finite && !report.stages_converged ? 1 : 0;
    out.halved += report.parts > 1 ? 1 : 0;
    out.most_parts = std::max(out.most_parts, report.parts);
    out.impacts += report.impact ? 1 : 0;
    out.contacts += report.contacts > 0 || report.impact ? 1 : 0;

    const double kinetic_now = world.KineticEnergy(), now = energy();
    if (!std::isfinite(now)) {
      out.finite = false;
      break;
    }
    kinetic = std::max(kinetic, kinetic_now);
    for (int b = 0; b < n; ++b) {
      const RigidTransform X = m.BodyPose(BodyIndex(b));
      const Vector6 V = m.BodyVelocity(BodyIndex(b));
      if (!V.allFinite() || !X.translation().allFinite()) out.finite = false;
      out.largest_turn = std::max(out.largest_turn, h * V.head<3>().norm());
      const double radius = c.radius[static_cast<std::size_t>(b)];
      if (radius > 0 && !c.scene.world.empty()) {
        const double z = (X * m.mechanism().body(BodyIndex(b)).inertia_B.center).z();
        out.passage = std::max(out.passage, (floor + radius - z) / (2 * radius));
      }
    }
    for (const Mechanism::Rotation& rotation : m.mechanism().rotations()) {
      Vector3 theta;
      for (int k = 0; k < 3; ++k)
        theta(k) = m.configuration().q(rotation.coordinates[static_cast<std::size_t>(k)]);
      out.largest_rotation_vector = std::max(out.largest_rotation_vector, (rotation.axes * theta).norm());
    }
    {
      const VectorX rate = m.configuration().Q_now * m.state().w;
      for (int k = 0, at = 0; k < m.mechanism().num_joints(); ++k)
        for (const FreedomDef& f : m.mechanism().definition().joints[static_cast<std::size_t>(k)].freedoms)
          if (const double turn = h * std::abs(rate(at++)); f.screw_B.head<3>().isZero(0))
            out.largest_turn = std::max(out.largest_turn, turn / c.size);
          else
            out.largest_turn = std::max(out.largest_turn, turn);
    }
    if (HasInput(c, i)) {
      // Its impulse squared, over the mass.
      explained += std::pow((c.push.force.norm() + c.push.moment.norm() / c.size) * h * c.steps, 2) / mass;
    } else if (i >= since) {
      // Push-out and the compliance of contacts lift by up to their depth, 10 um by default.
      if (report.contacts > 0 || report.impact)
        lift = std::max(lift, (mass + block) * 9.81 * (c.step.material.depth + report.max_penetration));
      // Energies of stiff servos far from their set-points are differences of large numbers.
      const double rounding = 1e-15 * energy_size;
      if (now - start - lift - rounding > excess) excess = now - start - lift - rounding, out.energy_step = i;
    }
    if (trace)
      std::cout << i << ": kinetic " << kinetic_now << ", energy " << now - start << ", parts "
                << report.parts << " (" << static_cast<int>(report.halving) << " of "
                << world.NameOf(report.halving_of) << "), iterations " << report.stage_iterations
                << ", contacts " << report.contacts << ", penetration " << report.max_penetration
                << ", limits " << report.limits << ", at bound " << report.forces_at_bound << ", residual "
                << report.stage_residual << ", refreshes " << report.refreshes << ", turn "
                << out.largest_turn << ", angular " << (ComputeMomenta(m).angular - first.angular).norm()
                << (report.finite ? "" : ", UNDONE") << (report.stages_converged ? "" : ", UNSOLVED") << '\n';
    if (out.has_momentum && !HasInput(c, i)) {
      const Momenta p = ComputeMomenta(m);
      const Vector3 weight = m.mechanism().total_mass() * (i + 1 - since) * h * c.step.gravity;
      linear_scale = std::max({linear_scale, p.linear_scale, first.linear_scale, weight.norm()});
      angular_scale = std::max({angular_scale, p.angular_scale, first.angular_scale});
      if (out.undone == 0) {
        out.linear_error = std::max(out.linear_error, (p.linear - first.linear - weight).norm());
        out.angular_error = std::max(out.angular_error, (p.angular - first.angular).norm());
      }
    }
  }
  out.kinetic_ratio = kinetic / std::max(explained, 1e-300);
  // A stage is solved to a displacement of 1e-8 of the size at best.
  kinetic = std::max(kinetic, mass * std::pow(1e-8 * c.size / h, 2));
  out.energy_excess = excess / kinetic;
  // A pendulum of this size turns by h (g/size)^(1/2) of a radian of its phase.
  const double phase = h * std::sqrt(g / c.size);
  out.energy_allowed =
      kEnergyShare * std::max({std::pow(h / kEnergyStep, 2), std::pow(out.largest_turn / kEnergyTurn, 2),
                               std::pow(phase / kEnergyTurn, 2)});
  out.linear_error /= std::max(linear_scale, 1e-300);
  out.angular_error /= std::max(angular_scale, 1e-300);
  return out;
}

}  // namespace fork1s::random_motion
