// Every field of a state by name, so that a hash forgets none: a struct with a member more than is named here
// does not compile.
#include <fork1s/world/world_state.hpp>

#include <cstring>

namespace fork1s {
namespace {

class Hash {
 public:
  std::uint64_t value() const { return value_; }

  template <typename... Field>
  void Add(const Field&... fields) {
    (One(fields), ...);
  }

 private:
  // An odd factor and a shift lose nothing: two states that differ in one word never meet by it.
  void Word(std::uint64_t word) {
    value_ = (value_ ^ word) * 0x9e3779b97f4a7c15ull;
    value_ ^= value_ >> 29;
  }
  void One(double x) {
    std::uint64_t word;
    std::memcpy(&word, &x, sizeof word);
    Word(word);
  }
  void One(int x) { Word(static_cast<std::uint64_t>(x)); }
  void One(bool x) { Word(x); }
  void One(signed char x) { Word(static_cast<std::uint64_t>(x)); }
  template <typename Derived>
  void One(const Eigen::PlainObjectBase<Derived>& m) {
    Word(static_cast<std::uint64_t>(m.rows()));
    Word(static_cast<std::uint64_t>(m.cols()));
    for (Eigen::Index i = 0; i < m.size(); ++i) One(m.data()[i]);
  }
  void One(const RigidTransform& X) { Add(X.rotation(), X.translation()); }
  template <typename T>
  void One(const std::vector<T>& list) {
    Word(list.size());
    for (const T& item : list) One(item);
  }
  void One(const std::shared_ptr<const ReducedModel>& model) { One(model->q_ref); }
  void One(const ReducedState& state) {
    const auto& [z, w, X_WR, V_R] = state;
    Add(z, w, X_WR, V_R);
  }
  void One(const MechanismState& state) {
    const auto& [model, step_model, reduced, expanded_at, mu, controls, controls_from, controls_move,
                 activation, driven_next, knows_driven_rate, driven_rate, base_history, loads, has_loads,
                 point_spring, point_spring_body, at_bound, missing_time, reference_age, acceleration] =
        state;
    if (controls_move || controls_from != controls) Add(controls_from);
    if (activation.size() > 0) Add(activation);
    if (knows_driven_rate) Add(driven_rate);
    if (base_history.h > 0) Add(base_history);
    if (point_spring.IsActive()) Add(point_spring, point_spring_body.value());
    if (expanded_at.size() > 0) Add(expanded_at);
    Add(model, reduced, mu, controls, driven_next, loads, has_loads, at_bound, missing_time, reference_age,
        acceleration);
  }
  void One(const BaseHistory& history) {
    const auto& [h, h_before, mean_rate, mean_rate_before] = history;
    Add(h, h_before, mean_rate, mean_rate_before);
  }
  void One(const PointSpring& spring) {
    const auto& [point_B, target_start_W, target_W, stiffness, damping] = spring;
    Add(point_B, target_start_W, target_W, stiffness, damping);
  }
  void One(const AppliedForces& load) {
    const auto& [force_W, moment_W, force_moments] = load;
    Add(force_W, moment_W, force_moments);
  }
  void One(const FreeBody::State& state) {
    const auto& [X_WB, omega_B, velocity, load, point_spring, angular_acceleration_B, acceleration] = state;
    if (point_spring.IsActive()) Add(point_spring);
    Add(X_WB, omega_B, velocity, load, angular_acceleration_B, acceleration);
  }
  void One(const ContactPoint& p) {
    // Of laws that every detection finds anew no step starts from those in the record.
    const auto& [body_a, body_b, geometry_a, geometry_b, point, frame, gap, friction, friction_scale, torsion,
                 rolling, restitution, adhesion_gap, adhesion, surface_velocity] = p;
    Add(body_a, body_b, geometry_a, geometry_b, point, frame, gap, friction, torsion, rolling, restitution);
    Add(adhesion_gap);
  }
  void One(const ContactRecord& record) {
    const auto& [point, impulse, normal_sum, tangential_sum, pull, friction, moment, use, gives_way,
                 end_force, end_moment, end_speed] = record;
    // Sums of magnitudes, pulls and what gives way are for reports: no step starts from them.
    Add(point, impulse, friction, moment, use, end_force, end_moment, end_speed);
  }
  void One(const WorldState::Rows& rows) {
    const auto& [limit_impulses, friction_impulses, refreshed] = rows;
    Add(limit_impulses, friction_impulses, refreshed);
  }

  std::uint64_t value_ = 0x243f6a8885a308d3ull;
};

}  // namespace

std::uint64_t HashOf(const WorldState& state, const VectorX& inputs) {
  // Records of switched closures are for reports: no step starts from them.
  const auto& [mechanisms, free_bodies, contacts, contacts_h, collision_body_poses, contraction, rows,
               switched_closures] = state;
  Hash hash;
  hash.Add(mechanisms, free_bodies, contacts, contacts_h, collision_body_poses, contraction[0],
           contraction[1], rows, inputs);
  return hash.value();
}

}  // namespace fork1s
