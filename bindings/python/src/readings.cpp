#include "readings.hpp"

#include <fork1s/sim/queries.hpp>
#include <fork1s/sim/run_statistics.hpp>

namespace fork1s::python {
namespace {

static_assert(sizeof(ContactRow) == 8 + 18 * sizeof(double));

ContactRow Row(int a, int b, const Vector3& point, const Vector3& normal, const Vector3& force) {
  ContactRow row{};
  row.bodies[0] = a;
  row.bodies[1] = b;
  Eigen::Map<Vector3>(row.point) = point;
  Eigen::Map<Vector3>(row.normal) = normal;
  Eigen::Map<Vector3>(row.force) = force;
  return row;
}

}  // namespace

Table Poses(const Simulation& simulation) {
  std::vector<RigidTransform> X_WB;
  simulation.Poses(X_WB);
  const std::size_t count = X_WB.size();
  std::vector<double> rows(7 * count);
  for (std::size_t i = 0; i < count; ++i) WritePose(X_WB[i], &rows[7 * i]);
  return {std::move(rows), count, 7};
}

Table Velocities(const Simulation& simulation) {
  const std::size_t count = simulation.bodies().size();
  std::vector<double> rows(6 * count);
  for (std::size_t i = 0; i < count; ++i) {
    const Vector6 V = simulation.Velocity(static_cast<int>(i));
    std::copy(V.data(), V.data() + 6, &rows[6 * i]);
  }
  return {std::move(rows), count, 6};
}

std::vector<double> JointCoordinates(const Simulation& simulation) {
  std::vector<double> all;
  for (std::size_t i = 0; i < simulation.scene().mechanisms.size(); ++i) {
    const VectorX q = simulation.JointCoordinates(static_cast<int>(i));
    all.insert(all.end(), q.data(), q.data() + q.size());
  }
  return all;
}

std::vector<double> JointRates(const Simulation& simulation) {
  std::vector<double> all;
  for (const auto& m : simulation.State().mechanisms)
    all.insert(all.end(), m.q_dot.data(), m.q_dot.data() + m.q_dot.size());
  return all;
}

std::vector<ContactRow> Contacts(const Simulation& simulation) {
  std::vector<ContactRow> rows;
  for (const BodyContact& c : fork1s::Contacts(simulation)) {
    ContactRow& row = rows.emplace_back(Row(c.body_a, c.body_b, c.point_W, c.normal_W, c.force_W));
    Eigen::Map<Vector3>(row.torque) = c.moment_W;
    row.gap = c.gap;
    row.friction = c.friction;
    Eigen::Map<Vector3>(row.pull) = c.pull_W;
    row.friction_use = ContactLoad::OfContact(c.force_W, c.normal_W, c.friction).FrictionUse();
  }
  return rows;
}

nb::object ToArray(std::vector<ContactRow> rows) {
  const std::size_t bytes = rows.size() * sizeof(ContactRow);
  auto* kept = new std::vector<ContactRow>(std::move(rows));
  nb::capsule owner(kept, [](void* p) noexcept { delete static_cast<std::vector<ContactRow>*>(p); });
  // numpy wants an address even of nothing.
  static std::uint8_t none = 0;
  std::uint8_t* data = bytes > 0 ? reinterpret_cast<std::uint8_t*>(kept->data()) : &none;
  const nb::object raw = nb::cast(nb::ndarray<nb::numpy, std::uint8_t>(data, 1, &bytes, owner));
  return raw.attr("view")(nb::module_::import_("fork1s._contacts").attr("CONTACT"));
}

}  // namespace fork1s::python
