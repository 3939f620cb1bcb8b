#include <fork1s/reference/full_simulation.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "simulation_detail.hpp"

namespace fork1s {

using internal::FullFreeBody;
using internal::FullMechanism;

namespace {

// A shape or pair with adhesion of its own, as messages name it; empty: none.
std::string AdheringShapeOf(const Scene& scene) {
  std::string found;
  const auto look = [&](const std::vector<GeometryDef>& geometries) {
    for (const GeometryDef& g : geometries)
      if (g.adhesion > 0) found = "geometry '" + g.name + "'";
  };
  look(scene.world);
  for (const FreeBodyDef& b : scene.free_bodies) look(b.geometries);
  for (const MechanismDef& m : scene.mechanisms)
    for (const BodyDef& b : m.bodies) look(b.geometries);
  for (const ContactPairDef& pair : scene.contact_pairs)
    if (pair.adhesion > 0) found = "contact pair '" + pair.name + "'";
  return found;
}

}  // namespace

FullSimulation::FullSimulation() : detail_(std::make_unique<Detail>()) {}
FullSimulation::~FullSimulation() = default;
FullSimulation::FullSimulation(FullSimulation&&) noexcept = default;
FullSimulation& FullSimulation::operator=(FullSimulation&&) noexcept = default;

Expected<FullSimulation> FullSimulation::Create(Scene scene, const FullSimulationOptions& options) {
  FullSimulation s;
  Detail& d = *s.detail_;
  d.scene = std::move(scene);
  d.options = options;
  d.dt = options.dt > 0 ? options.dt : d.scene.timestep;
  if (!(d.dt > 0) || !std::isfinite(d.dt))
    return Fail(ErrorCode::kModel, "scene '" + d.scene.name + "'", "needs a time step above 0 s");
  const KeyframeDef* key = nullptr;
  if (options.initial_keyframe >= 0) {
    FORK1S_REQUIRE(options.initial_keyframe < static_cast<int>(d.scene.keyframes.size()),
                   options.initial_keyframe);
    key = &d.scene.keyframes[static_cast<std::size_t>(options.initial_keyframe)];
  }
  for (const MechanismDef& m : d.scene.mechanisms)
    if (!m.adhesions.empty())
      return Fail(
          ErrorCode::kModel, "adhesion '" + m.adhesions.front().name + "' of mechanism '" + m.name + "'",
          "the full model knows no adhesion; run the reduced model, or take the actuator out of the file");
  if (const std::string shape = AdheringShapeOf(d.scene); !shape.empty())
    return Fail(ErrorCode::kModel, shape, "the full model knows no adhesion; run the reduced model");
  for (const MechanismDef& m : d.scene.mechanisms)
    if (!m.switched_closures.empty())
      return Fail(
          ErrorCode::kModel,
          "equality '" + m.switched_closures.front().name + "' of mechanism '" + m.name + "'",
          "the full model knows no equality that is switched while it runs; run the reduced model, compare "
          "it with MuJoCo, or take the equality out of the file");
  if (auto ok = d.AddMechanisms(key); !ok) return tl::unexpected(ok.error());
  if (auto ok = d.AddFreeBodies(key); !ok) return tl::unexpected(ok.error());
  d.AddControls(key);
  const auto interfaces = d.Interfaces();
  if (!interfaces) return tl::unexpected(interfaces.error());
  for (std::size_t i = 0; i < d.mechanisms.size(); ++i) {
    const Mechanism& m = d.mechanisms[i].mechanism();
    const auto& named = (*interfaces)[i];
    for (int b = 0; b < m.num_bodies(); ++b)
      d.bodies.push_back({m.body(BodyIndex(b)).name, static_cast<int>(i), b,
                          std::find(named.begin(), named.end(), b) != named.end()});
  }
  for (std::size_t i = 0; i < d.free_bodies.size(); ++i)
    d.bodies.push_back({d.scene.free_bodies[i].name, -1, static_cast<int>(i), false});
  if (auto ok = d.contact_set.Build(d.scene, d.mechanisms, d.free_bodies, *interfaces, options.collision);
      !ok)
    return tl::unexpected(ok.error());
  d.PassControls();
  return s;
}

Expected<void> FullSimulation::Detail::AddMechanisms(const KeyframeDef* key) {
  for (std::size_t i = 0; i < scene.mechanisms.size(); ++i) {
    auto built = BuildMechanism(scene.mechanisms[i]);
    if (!built) return tl::unexpected(built.error());
    auto shared = std::make_shared<const Mechanism>(std::move(*built));
    VectorX q = VectorX::Zero(shared->num_coordinates()), q_dot;
    RigidTransform X_WR = scene.mechanisms[i].X_WR;
    Vector6 V_R = Vector6::Zero();
    if (key) {
      const auto& state = key->mechanisms[i];
      q = state.q;
      q_dot = state.q_dot;
      X_WR = state.X_WR;
      V_R = state.V_R;
    }
    auto mechanism = FullMechanism::Create(shared, q, q_dot, X_WR, V_R);
    if (!mechanism) return tl::unexpected(mechanism.error());
    if (key && key->mechanisms[i].controls.size() > 0) {
      FORK1S_REQUIRE(key->mechanisms[i].controls.size() == mechanism->controls.size());
      mechanism->controls = key->mechanisms[i].controls;
    }
    for (const std::string& w : mechanism->warnings()) warnings.push_back(w);
    base_start.push_back(X_WR);
    base_now.push_back(X_WR);
    base_next.push_back(X_WR);
    base_rate_next.emplace_back();
    base_history.emplace_back();
    base_path.emplace_back();
    mechanisms.push_back(std::move(*mechanism));
  }
  return {};
}

Expected<void> FullSimulation::Detail::AddFreeBodies(const KeyframeDef* key) {
  for (std::size_t i = 0; i < scene.free_bodies.size(); ++i) {
    const FreeBodyDef& def = scene.free_bodies[i];
    if (!(def.inertia.mass > 0) || !(def.inertia.rotational.determinant() > 0))
      return Fail(ErrorCode::kModel, "body '" + def.name + "'",
                  "moves freely and needs mass and rotational inertia above 0");
    free_bodies.emplace_back(def);
    if (!key) continue;
    const auto& state = key->free_bodies[i];
    free_bodies.back().SetState(state.X_WB, state.omega_W, state.velocity_W);
  }
  return {};
}

Expected<std::vector<std::vector<int>>> FullSimulation::Detail::Interfaces() const {
  if (!options.interfaces.empty() && options.interfaces.size() != mechanisms.size())
    return Fail(ErrorCode::kUsage, "interfaces", "needs one list a mechanism, or none at all");
  std::vector<std::vector<int>> found(mechanisms.size());
  for (std::size_t i = 0; i < mechanisms.size(); ++i) {
    const Mechanism& m = mechanisms[i].mechanism();
    const bool chosen = !options.interfaces.empty() && !options.interfaces[i].empty();
    for (const std::string& name : chosen ? options.interfaces[i] : m.definition().interfaces) {
      const BodyIndex b = m.FindBody(name);
      if (!b.valid())
        return Fail(ErrorCode::kModel, "interface '" + name + "'",
                    "mechanism '" + m.name() + "' has no body of this name");
      found[i].push_back(b.value());
    }
  }
  return found;
}

void FullSimulation::Detail::AddControls(const KeyframeDef* key) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  std::vector<double> values, starts, lower, upper;
  auto add = [&](const std::string& name, double value, double low, double high) {
    control_names.push_back(name);
    values.push_back(value);
    lower.push_back(low);
    upper.push_back(high);
  };
  for (std::size_t i = 0; i < mechanisms.size(); ++i) {
    const FullMechanism& m = mechanisms[i];
    const bool given = key && key->mechanisms[i].activation.size() > 0;
    FORK1S_REQUIRE(!given || key->mechanisms[i].activation.size() == m.controls.size());
    for (std::size_t k = 0; k < m.mechanism().controls().size(); ++k) {
      const Mechanism::Control& c = m.mechanism().controls()[k];
      add(c.name, m.controls(static_cast<Eigen::Index>(k)), c.lower, c.upper);
      const ControlDef& def = m.mechanism().definition().controls[k];
      dynamics.push_back(def.dynamics == ControlDynamics::kNone ? nullptr : &def);
      starts.push_back(given ? key->mechanisms[i].activation(static_cast<Eigen::Index>(k))
                             : def.initial_activation);
    }
  }
  for (const FullMechanism& m : mechanisms)
    if (m.mechanism().base() == BaseKind::kDriven)
      for (const char* axis : {".x", ".y", ".z", ".rx", ".ry", ".rz"})
        add(m.mechanism().bodies()[0].name + axis, 0, -kInfinity, kInfinity);
  auto vector = [](const std::vector<double>& v) {
    return VectorX(Eigen::Map<const VectorX>(v.data(), static_cast<Eigen::Index>(v.size())));
  };
  controls = vector(values);
  const auto num_inputs =
      std::accumulate(mechanisms.begin(), mechanisms.end(), Eigen::Index{0},
                      [](Eigen::Index n, const FullMechanism& m) { return n + m.controls.size(); });
  dynamics.resize(values.size(), nullptr);  // a driven base has none
  starts.resize(values.size(), 0);
  activation = vector(starts);
  base_rates = VectorX::Constant(controls.size() - num_inputs, std::numeric_limits<double>::quiet_NaN());
  controls_before = controls;
  control_lower = vector(lower);
  control_upper = vector(upper);
}

void FullSimulation::Detail::PassControls() {
  Eigen::Index next = 0;
  for (FullMechanism& m : mechanisms) {
    for (Eigen::Index k = 0; k < m.controls.size(); ++k, ++next)
      m.controls(k) = dynamics[static_cast<std::size_t>(next)] ? activation(next) : controls(next);
  }
  for (std::size_t i = 0; i < mechanisms.size(); ++i) {
    if (mechanisms[i].mechanism().base() != BaseKind::kDriven) continue;
    const Vector3 shift = controls.segment<3>(next), turn = controls.segment<3>(next + 3);
    base_rate_next[i] = BaseRateOf(controls.segment<6>(next), controls_before.segment<6>(next),
                                   base_rates.segment<6>(next - (controls.size() - base_rates.size())));
    next += 6;
    base_next[i] = {Matrix3(ExpRotation(turn) * base_start[i].rotation()),
                    Vector3(base_start[i].translation() + shift)};
    mechanisms[i].driven_next = base_next[i];
  }
}

FullStepReport FullSimulation::Step() { return detail_->Step(); }
double FullSimulation::time() const { return static_cast<double>(detail_->steps) * detail_->dt; }
std::int64_t FullSimulation::steps() const { return detail_->steps; }
double FullSimulation::dt() const { return detail_->dt; }
FullIntegrator FullSimulation::integrator() const { return detail_->options.integrator; }
const Scene& FullSimulation::scene() const { return detail_->scene; }
const std::vector<std::string>& FullSimulation::warnings() const { return detail_->warnings; }
const std::vector<std::string>& FullSimulation::control_names() const { return detail_->control_names; }
const VectorX& FullSimulation::controls() const { return detail_->controls; }
const std::vector<FullBody>& FullSimulation::bodies() const { return detail_->bodies; }
const std::vector<FullContact>& FullSimulation::contacts() const { return detail_->contacts; }
int FullSimulation::num_mechanisms() const { return static_cast<int>(detail_->mechanisms.size()); }

int FullSimulation::FindControl(const std::string& name) const {
  const auto& names = detail_->control_names;
  const auto at = std::find(names.begin(), names.end(), name);
  return at == names.end() ? -1 : static_cast<int>(at - names.begin());
}

void FullSimulation::SetControl(int index, double value) {
  Detail& d = *detail_;
  FORK1S_REQUIRE(index >= 0 && index < d.controls.size(), index);
  FORK1S_REQUIRE(std::isfinite(value), d.control_names[static_cast<std::size_t>(index)], value);
  d.controls(index) = std::clamp(value, d.control_lower(index), d.control_upper(index));
}

void FullSimulation::SetControls(const VectorX& values) {
  FORK1S_REQUIRE(values.size() == detail_->controls.size(), values.size(), detail_->controls.size());
  for (int i = 0; i < values.size(); ++i) SetControl(i, values(i));
}

void FullSimulation::StartFromControls() {
  Detail& d = *detail_;
  FORK1S_REQUIRE(d.steps == 0, d.steps);
  const Eigen::Index count = d.controls.size() - d.base_rates.size();
  d.controls_before.head(count) = d.controls.head(count);
  d.base_rates.setConstant(std::numeric_limits<double>::quiet_NaN());
}

void FullSimulation::SetBaseRates(const VectorX& rates) {
  Detail& d = *detail_;
  FORK1S_REQUIRE(rates.size() == d.base_rates.size(), rates.size(), d.base_rates.size());
  d.base_rates = rates;
}

void FullSimulation::SetGravity(const Vector3& gravity_W) {
  FORK1S_REQUIRE(gravity_W.allFinite());
  detail_->scene.gravity = gravity_W;
}

namespace {

const FullBody& BodyAt(const std::vector<FullBody>& bodies, int body) {
  FORK1S_REQUIRE(body >= 0 && body < static_cast<int>(bodies.size()), body);
  return bodies[static_cast<std::size_t>(body)];
}

}  // namespace

void FullSimulation::ApplyWrench(int body, const Vector3& force_W, const Vector3& moment_W,
                                 const Vector3& point_W) {
  const FullBody& b = BodyAt(detail_->bodies, body);
  FORK1S_REQUIRE(force_W.allFinite() && moment_W.allFinite() && point_W.allFinite());
  if (b.mechanism < 0)
    detail_->free_bodies[static_cast<std::size_t>(b.index)].AddWrench(force_W, moment_W, point_W);
  else
    detail_->mechanisms[static_cast<std::size_t>(b.mechanism)].AddWrench(b.index, force_W, moment_W, point_W);
}

int FullSimulation::FindBody(const std::string& name) const {
  for (std::size_t i = 0; i < detail_->bodies.size(); ++i)
    if (detail_->bodies[i].name == name) return static_cast<int>(i);
  return -1;
}

RigidTransform FullSimulation::Pose(int body) const {
  const FullBody& b = BodyAt(detail_->bodies, body);
  if (b.mechanism < 0) return detail_->free_bodies[static_cast<std::size_t>(b.index)].pose();
  return detail_->mechanisms[static_cast<std::size_t>(b.mechanism)].Pose(b.index);
}

Vector6 FullSimulation::Velocity(int body) const {
  const FullBody& b = BodyAt(detail_->bodies, body);
  if (b.mechanism < 0) return detail_->free_bodies[static_cast<std::size_t>(b.index)].Velocity();
  const FullMechanism& m = detail_->mechanisms[static_cast<std::size_t>(b.mechanism)];
  return InAxes(m.Pose(b.index).rotation(), m.BodyTwist(b.index));
}

const Mechanism& FullSimulation::mechanism(int i) const {
  return detail_->mechanisms.at(static_cast<std::size_t>(i)).mechanism();
}
const VectorX& FullSimulation::Displacements(int mechanism) const {
  return detail_->mechanisms.at(static_cast<std::size_t>(mechanism)).q();
}
const VectorX& FullSimulation::Rates(int mechanism) const {
  return detail_->mechanisms.at(static_cast<std::size_t>(mechanism)).q_dot();
}
VectorX FullSimulation::ClosureForces(int mechanism) const {
  return detail_->mechanisms.at(static_cast<std::size_t>(mechanism)).ClosureForces();
}
std::vector<double> FullSimulation::Frequencies(int mechanism, int count) const {
  return detail_->mechanisms.at(static_cast<std::size_t>(mechanism)).Frequencies(count);
}

MatrixX FullSimulation::Compliance(int mechanism, const std::vector<BodyIndex>& bodies) const {
  return detail_->mechanisms.at(static_cast<std::size_t>(mechanism)).Compliance(bodies);
}

std::vector<FullGap> FullSimulation::JointGaps() const {
  std::vector<FullGap> gaps;
  for (const FullMechanism& m : detail_->mechanisms)
    for (auto& [name, gap] : m.Gaps()) gaps.push_back({name, gap});
  std::stable_sort(gaps.begin(), gaps.end(),
                   [](const FullGap& a, const FullGap& b) { return a.gap > b.gap; });
  return gaps;
}

double FullSimulation::KineticEnergy() const {
  double energy = 0;
  for (const FullMechanism& m : detail_->mechanisms) energy += m.KineticEnergy();
  for (const FullFreeBody& b : detail_->free_bodies) energy += b.KineticEnergy();
  return energy;
}

double FullSimulation::SpringEnergy() const {
  double energy = 0;
  for (const FullMechanism& m : detail_->mechanisms) energy += m.StoredEnergy();
  return energy;
}

double FullSimulation::GravityEnergy() const {
  double energy = 0;
  for (const FullMechanism& m : detail_->mechanisms) energy += m.GravityEnergy(detail_->scene.gravity);
  for (const FullFreeBody& b : detail_->free_bodies) energy += b.GravityEnergy(detail_->scene.gravity);
  return energy;
}

Vector6 FullSimulation::Momentum() const {
  Vector6 total = Vector6::Zero();
  for (const FullMechanism& m : detail_->mechanisms) total += m.Momentum();
  for (const FullFreeBody& b : detail_->free_bodies) total += b.Momentum();
  return total;
}

}  // namespace fork1s
