// Loops of one freedom whose crank goes round: through every pose that they have, dead centres among them.
#include <draws.hpp>
#include <random_mechanism.hpp>
#include <stepping/support.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

namespace fork1s {
namespace {

using testing::MustStart;
using testing::RandomSource;
using testing::Still;

enum class Family { kFourBar, kSliderCrank, kSpatialRocker, kSpatialSlider };
constexpr const char* kFamilyNames[] = {"four-bar", "slider-crank", "spatial rocker", "spatial slider"};

// A crank about z at the origin of its base, a rod on its pin and a follower that the rod's far end moves: a
// rocker about the third axis of its frame, or a slider along the first. The rod hangs on a hinge about z in a
// plane, else on a universal joint that turns about z first, so that it cannot spin about itself.
class Loop {
 public:
  // Draws until the crank can go all the way round. `straight` of 1 would let rod and rocker, or rod and what is
  // square to the slider, come into one line, where the loop has two ways to go on.
  explicit Loop(unsigned seed) : random(seed), family(static_cast<Family>(seed % 4)) {
    constexpr double straight = 0.97, steep = 0.5;
    const bool planar = family == Family::kFourBar || family == Family::kSliderCrank;
    slides = family == Family::kSliderCrank || family == Family::kSpatialSlider;
    do {
      crank = random.Uniform(0.04, 0.12);
      rod = random.Uniform(0.1, 0.4);
      rocker = random.Uniform(0.1, 0.4);
      branch = random.Chance(0.5) ? 1 : -1;
      const double a = random.Uniform(-3, 3);
      follower.rotation() = planar ? ExpRotation(Vector3(0, 0, a)) : random.Pose(1).rotation();
      follower.translation() = random.InBox(0.3);
      if (planar) follower.translation().z() = 0;
    } while (!GoesRound(straight, planar ? 1 : steep));
    start = random.Uniform(-3, 3);
    for (SpatialInertia& I : inertia) I = random.Inertia();
  }

  Vector3 Pin(double phi) const { return crank * Vector3(std::cos(phi), std::sin(phi), 0); }

  // Where the follower is: an angle or a way. The rod's end is a circle's or line's point that far from the pin.
  // `share`: of what there would be in a dead centre.
  double Follow(double phi, double* share = nullptr) const {
    const Vector3 p = follower.rotation().transpose() * (Pin(phi) - follower.translation());
    if (slides) {
      const double off = std::hypot(p.y(), p.z());
      if (share) *share = off / rod;
      return p.x() + branch * std::sqrt(std::max(0.0, rod * rod - off * off));
    }
    const double reach = std::hypot(p.x(), p.y());
    const double cosine = (p.squaredNorm() + rocker * rocker - rod * rod) / (2 * rocker * reach);
    if (share) *share = std::abs(cosine);
    return std::atan2(p.y(), p.x()) + branch * std::acos(std::clamp(cosine, -1.0, 1.0));
  }

  // Where the follower's and the rod's ends meet.
  Vector3 RodEnd(double phi) const { return Follower(phi) * RodEndOnFollower(); }
  Vector3 RodEndOnFollower() const { return slides ? Vector3::Zero() : Vector3(rocker, 0, 0); }
  RigidTransform Follower(double phi) const {
    const double at = Follow(phi);
    return follower * (slides ? RigidTransform(Vector3(at, 0, 0))
                              : RigidTransform(ExpRotation(Vector3(0, 0, at)), Vector3::Zero()));
  }

  // Poses of crank, rod and follower in the base at this angle of the crank, in closed form.
  std::array<RigidTransform, 3> Poses(double phi) const {
    const Vector3 along = (RodEnd(phi) - Pin(phi)).normalized();
    Matrix3 R;
    R.col(0) = along;
    R.col(1) = Vector3::UnitZ().cross(along).normalized();
    R.col(2) = R.col(0).cross(R.col(1));
    return {RigidTransform(ExpRotation(Vector3(0, 0, phi)), Vector3::Zero()), RigidTransform(R, Pin(phi)),
            Follower(phi)};
  }

  // What the crank feels: twice the kinetic energy at a rate of 1 rad/s, by central differences of the poses.
  double Inertia(double phi) const {
    constexpr double d = 1e-5;
    const auto before = Poses(phi - d), after = Poses(phi + d), here = Poses(phi);
    double sum = 0;
    for (std::size_t b = 0; b < 3; ++b) {
      const Vector3 v = (after[b] * inertia[b].center - before[b] * inertia[b].center) / (2 * d);
      const Matrix3 W =
          here[b].rotation().transpose() * (after[b].rotation() - before[b].rotation()) / (2 * d);
      const Vector3 w = 0.5 * Vector3(W(2, 1) - W(1, 2), W(0, 2) - W(2, 0), W(1, 0) - W(0, 1));
      sum += inertia[b].mass * v.squaredNorm() + w.dot(inertia[b].rotational * w);
    }
    return sum;
  }

  // Of a function of the angle, over a turn. What is periodic and smooth needs no more than the plain sum.
  template <class F>
  double Mean(int parts, F&& f) const {
    double sum = 0;
    for (int i = 0; i < parts; ++i) sum += f(2 * M_PI * i / parts);
    return sum / parts;
  }

  // m or rad between the follower's ends.
  double Way() const {
    double low = 1e9, high = -1e9, last = Follow(start), turns = 0;
    for (int i = 0; i <= 64; ++i) {
      double now = Follow(start + 2 * M_PI * i / 64);
      if (!slides) {
        turns += std::remainder(now - last, 2 * M_PI);
        last = now;
        now = turns;
      }
      low = std::min(low, now), high = std::max(high, now);
    }
    return high - low;
  }

  RandomSource random;
  Family family;
  bool slides = false;
  double crank = 0, rod = 0, rocker = 0, branch = 1, start = 0;
  RigidTransform follower;
  SpatialInertia inertia[3];

 private:
  bool GoesRound(double straight, double steep) const {
    for (int i = 0; i < 72; ++i) {
      const double phi = 2 * M_PI * i / 72;
      double share = 1;
      Follow(phi, &share);
      if (!(share < straight)) return false;
      const RigidTransform R = Poses(phi)[1];
      if (std::abs(R.rotation()(2, 0)) > steep)
        return false;  // the rod along z, where a universal joint locks
    }
    return true;
  }
};

// How a loop is set going. Springs and weight hold a share of that energy at most, so nothing can stop the
// crank.
struct Drive {
  double energy = 0;  // J that it gets at the start, or by a motor on each radian of the crank
  bool motor = false;
  double spring = 0;  // of the follower
  Vector3 gravity = Vector3::Zero();
  double damping = 0;  // of the crank

  // Nothing but inertia: the crank's speed at each of its angles is that of its energy.
  bool Coasts() const { return !motor && spring == 0 && gravity.isZero(0) && damping == 0; }
};

Drive DriveOf(Loop& loop) {
  constexpr double kHeld = 0.2;
  RandomSource& random = loop.random;
  const double inertia = loop.Mean(24, [&](double phi) { return loop.Inertia(phi); });
  const double speed = random.Uniform(10, 25);  // rad/s, about what it goes round with
  Drive drive;
  drive.motor = random.Chance(0.4);
  drive.energy = inertia * speed * speed * (drive.motor ? 1 / (4 * M_PI) : 0.5);
  if (random.Chance(0.4)) drive.spring = 2 * kHeld * drive.energy / std::pow(loop.Way(), 2);
  if (random.Chance(0.4)) {
    double high = 0;
    for (int i = 0; i < 3; ++i) {
      const Vector3& c = loop.inertia[i].center;
      const auto at = [&](double phi) -> Vector3 { return loop.Poses(phi)[static_cast<std::size_t>(i)] * c; };
      // What is as far from a place of its own in the mean is no farther from anywhere than a few times that.
      high += 4 * loop.inertia[i].mass * loop.Mean(24, [&](double phi) { return (at(phi) - at(0)).norm(); });
    }
    drive.gravity = kHeld * drive.energy / high * random.Direction();
  }
  if (random.Chance(0.4)) drive.damping = 2e-3 * inertia * speed;
  return drive;
}

MechanismDef DefinitionOf(Loop& loop, const Drive& drive) {
  const auto poses = loop.Poses(loop.start);
  MechanismBuilder builder(kFamilyNames[static_cast<int>(loop.family)]);
  builder.SetBasePose(loop.random.Pose(0.5));
  const auto add = [&](const char* name, BodyIndex parent, const RigidTransform& X_PB, int i) {
    BodyDef body;
    body.name = name;
    body.parent = parent;
    body.X_PB = X_PB;
    body.inertia = loop.inertia[i];
    return builder.AddBody(body);
  };
  const BodyIndex crank = add("crank", builder.base(), poses[0], 0),
                  rod = add("rod", crank, poses[0].inverse() * poses[1], 1),
                  follower = add("follower", builder.base(), poses[2], 2);
  const JointIndex shaft =
      builder.AddJoint(JointDef::Hinge("shaft", crank, Vector3::UnitZ()).WithSpring(0, drive.damping));
  const Vector3 z = poses[1].rotation().transpose() * Vector3::UnitZ();
  if (loop.family == Family::kFourBar || loop.family == Family::kSliderCrank)
    builder.AddJoint(JointDef::Hinge("pin", rod, z));
  else
    builder.AddJoint(UniversalJoint("pin", rod, z, Vector3::UnitY()));
  builder.AddJoint((loop.slides ? JointDef::Slide("guide", follower, Vector3::UnitX())
                                : JointDef::Hinge("guide", follower, Vector3::UnitZ()))
                       .WithSpring(drive.spring));
  builder.AddClosure(
      ClosureDef::Connect("end", rod, follower, Vector3(loop.rod, 0, 0), loop.RodEndOnFollower()));
  ControlDef motor;
  motor.name = "motor";
  motor.terms.emplace_back(FreedomRef{shaft, 0}, 1.0);
  motor.gain = 1;
  builder.AddControl(motor);
  constexpr const char* kNames[] = {"crank", "rod", "follower"};
  builder.SetInterfaces({kNames[loop.random.Below(3)]});
  return builder.definition();
}

// Of a run until the crank has gone round and a quarter more. Energies are shares of what set it going.
struct Turned {
  bool finite = true, undamped = false;
  double gap = 0;                 // m by which the loop stood open, at most
  double off = 0;                 // m by which the follower's end was beside where the crank's angle puts it
  double gained = 0, lost = 0;    // at most above, at the end below what the start and the motor gave
  double angle = 0;               // rad
  double time = 0, coasting = 0;  // s for the first turn; in closed form, 0 where more than inertia acts
  int refreshes = 0;
};

constexpr double kOnce = 2 * M_PI;

Turned Turn(unsigned seed, Integrator integrator, double h) {
  Loop loop(seed);
  const Drive drive = DriveOf(loop);
  const MechanismDef definition = DefinitionOf(loop, drive);
  const int n = testing::Share(definition)->num_coordinates();
  StepOptions step = Still(h);
  step.gravity = drive.gravity;
  step.integrator = integrator;
  VectorX q_dot = VectorX::Zero(n);
  if (!drive.motor) {
    // What the loop makes of the crank's rate alone is told by its energy, which goes with the square.
    q_dot(0) = 1;
    q_dot(0) = std::sqrt(drive.energy / MustStart(definition, VectorX::Zero(n), q_dot).KineticEnergy());
  }
  World world = MustStart(definition, VectorX::Zero(n), q_dot);
  MechanismDynamics& m = world.mechanisms()[0];
  const double torque = drive.motor ? drive.energy : 0;
  m.controls()(0) = torque;
  const BodyIndex crank = m.mechanism().FindBody("crank"), follower = m.mechanism().FindBody("follower");
  const auto in_base = [&](BodyIndex b) { return m.state().X_WR.inverse() * m.BodyPose(b); };
  // The world's potential energy would count a steady motor's work as its own.
  const auto energy = [&] {
    double sum = world.KineticEnergy() + 0.5 * drive.spring * std::pow(m.configuration().q(n - 1), 2);
    for (int b = 1; b < m.mechanism().num_bodies(); ++b) {
      const SpatialInertia& I = m.mechanism().body(BodyIndex(b)).inertia_B;
      sum -= I.mass * drive.gravity.dot(m.BodyPose(BodyIndex(b)) * I.center);
    }
    return sum;
  };
  const double start = energy();
  Turned turned;
  turned.undamped = drive.damping == 0;
  double last = loop.start;
  // A crank that hardly moves is not waited for.
  for (int i = 0; i * h < 4 && std::abs(turned.angle) < 1.25 * kOnce; ++i) {
    const StepReport report = world.Step(step);
    if (!report.finite || !std::isfinite(energy())) {
      turned.finite = false;
      break;
    }
    turned.refreshes += report.refreshes;
    turned.gap = std::max(turned.gap, m.ClosureGapNow());
    const Matrix3 R = in_base(crank).rotation();
    const double now = std::atan2(R(1, 0), R(0, 0)), before = std::abs(turned.angle);
    turned.angle += std::remainder(now - last, 2 * M_PI);
    last = now;
    const double after = std::abs(turned.angle);
    if (before < kOnce && after >= kOnce) turned.time = h * (i + (kOnce - before) / (after - before));
    turned.off =
        std::max(turned.off, (in_base(follower) * loop.RodEndOnFollower() - loop.RodEnd(now)).norm());
    const double left = (energy() - start - torque * turned.angle) / drive.energy;
    turned.gained = std::max(turned.gained, left);
    turned.lost = -left;
  }
  if (drive.Coasts())
    turned.coasting =
        kOnce * loop.Mean(128, [&](double phi) { return std::sqrt(loop.Inertia(phi) / (2 * drive.energy)); });
  return turned;
}

std::string Name(unsigned seed, Integrator integrator) {
  return "seed " + std::to_string(seed) + ", " + kFamilyNames[seed % 4] +
         (integrator == Integrator::kEuler ? ", euler" : ", two stages");
}

// What holds at any step. Loops are closed to 1e-10 of their size by each; the follower's end is beside its
// place by that gap and what a pose near a dead centre makes of it.
void ExpectRound(const Turned& t) {
  ASSERT_TRUE(t.finite);
  EXPECT_LT(t.gap, 1e-8);
  EXPECT_LT(t.off, 1e-7);
  EXPECT_GT(std::abs(t.angle), kOnce);
}

TEST(FullTurns, LoopsOfEachFamilyGoRound) {
  const unsigned seeds = testing::Seeds(60, 300);
  for (const Integrator integrator : {Integrator::kEuler, Integrator::kTwoStage}) {
    int coasted = 0, refreshes = 0;
    for (unsigned seed = 0; seed < seeds; ++seed) {
      SCOPED_TRACE(Name(seed, integrator));
      const Turned t = Turn(seed, integrator, 1.0 / 240);
      ExpectRound(t);
      refreshes += t.refreshes;
      // Shares of the energy at the start or of the motor's torque times a radian, of which it gives 7.8.
      // Where rod and rocker are nearly in line the crank is past its fastest in a few steps.
      const bool euler = integrator == Integrator::kEuler;
      EXPECT_LT(t.gained, euler ? 1e-9 : 0.02);
      if (t.undamped) {
        EXPECT_LT(t.lost, euler ? 2.5 : 0.1);
      }
      if (t.coasting == 0) continue;
      ++coasted;
      EXPECT_NEAR(t.time, t.coasting, (euler ? 0.3 : 0.03) * t.coasting);
    }
    EXPECT_GT(coasted, static_cast<int>(seeds) / 15);
    EXPECT_GT(refreshes, static_cast<int>(seeds) * 20);  // every 15 degrees
  }
}

// Steps so short that a run goes through hundreds between two references. Where the follower has the only spring,
// its dead centres are where that says nothing of the crank.
TEST(FullTurns, ShortStepsComeToTheClosedForm) {
  const unsigned seeds = testing::Seeds(12, 40);
  for (const Integrator integrator : {Integrator::kEuler, Integrator::kTwoStage})
    for (unsigned seed = 0; seed < seeds; ++seed) {
      SCOPED_TRACE(Name(seed, integrator));
      const Turned t = Turn(seed, integrator, 1.0 / 3840);
      ExpectRound(t);
      // Of first and of second order, a 16th and a 256th of those.
      const bool euler = integrator == Integrator::kEuler;
      EXPECT_LT(t.gained, euler ? 1e-9 : 0.02 / 256);
      if (t.undamped) {
        EXPECT_LT(t.lost, euler ? 2.5 / 16 : 0.1 / 256);
      }
      if (t.coasting > 0) {
        EXPECT_NEAR(t.time, t.coasting, (euler ? 0.3 / 16 : 0.03 / 256) * t.coasting);
      }
    }
}

}  // namespace
}  // namespace fork1s
