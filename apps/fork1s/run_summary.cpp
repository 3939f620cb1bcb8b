#include "run_summary.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fork1s/sim/sensors.hpp>
#include <fork1s/stepping/mechanism_dynamics.hpp>

#include "accuracy_output.hpp"
#include "base/percentile.hpp"
#include "error_output.hpp"
#include "print.hpp"
#include "run_contacts.hpp"

namespace fork1s::app {
namespace {

Json BasesJson(const Simulation& simulation, const Measured& m) {
  Json out = Json::array();
  for (std::size_t i = 0; i < simulation.scene().mechanisms.size(); ++i) {
    const auto number = static_cast<int>(i);
    const Mechanism& given = simulation.given_mechanism(number);
    if (given.base() == BaseKind::kFixed) continue;
    const Measured::BasePath& path = m.base_paths[i];
    const RigidTransform X = simulation.BasePose(number);
    const Vector6 V = InAxes(X.rotation(), simulation.BaseTwist(number));
    out.push_back({{"body", given.body(BodyIndex(0)).name},
                   {"position_m", ToJson(X.translation())},
                   {"quaternion_wxyz", ToJson(X.quaternion())},
                   {"velocity_m_per_s", ToJson(Vector3(V.tail<3>()))},
                   {"angular_velocity_rad_per_s", ToJson(Vector3(V.head<3>()))},
                   {"start_m", ToJson(path.start)},
                   {"path_m", path.length},
                   {"speed_max_m_per_s", path.speed_max}});
  }
  return out;
}

Json EndsJson(const std::vector<EndReached>& ends) {
  Json out = Json::array();
  for (const EndReached& e : ends)
    out.push_back({{"name", e.name},
                   {"end", e.upper && e.lower ? "both"
                           : e.upper          ? "upper"
                                              : "lower"},
                   {"steps", e.steps},
                   {"first_s", e.first},
                   {"last_s", e.last}});
  return out;
}

// Values at the end of the last step; NaN is null.
void AddSensors(const Simulation& simulation, Json& out) {
  const Sensors sensors(simulation);
  out["sensors"] = out["sensors_missing"] = Json::object();
  for (int i = 0; i < sensors.count(); ++i) {
    const SensorDef& sensor = sensors.definition(i);
    Json& values = out["sensors"][sensor.name] = Json::array();
    for (const double value : sensors[i])
      values.push_back(std::isfinite(value) ? Json(value) : Json(nullptr));
    if (!sensor.reason.empty()) out["sensors_missing"][sensor.name] = sensor.reason;
  }
}

}  // namespace

Json Summary(const Simulation& simulation, const Measured& m) {
  Json out;
  double wall = 0;
  for (double us : m.step_us) wall += us * 1e-6;
  auto percentile = [&](double p) { return m.step_us.empty() ? 0.0 : Percentile(m.step_us, p); };
  out["steps"] = m.step_us.size();
  out["dt_s"] = simulation.dt();
  out["integrator"] = Name(simulation.step_options().integrator);
  out["simulated_s"] = simulation.time();
  out["wall_s"] = wall;
  out["real_time_factor"] = wall > 0 ? Json(simulation.time() / wall) : Json(nullptr);
  out["contacts_max"] = m.contacts_max;
  out["energy_J"] = {{"first", m.energy_first},
                     {"last", m.energy_last},
                     {"max_increase", m.energy_increase},
                     {"friction_loss", m.statistics.FrictionLoss()}};
  out["interface"] = Json::array();
  out["free_bodies"] = Json::array();
  for (std::size_t i = 0; i < simulation.bodies().size(); ++i) {
    const SceneBody& b = simulation.bodies()[i];
    if (!b.is_interface && b.mechanism >= 0) continue;
    const RigidTransform X = simulation.Pose(static_cast<int>(i));
    out[b.mechanism < 0 ? "free_bodies" : "interface"].push_back(
        {{"body", b.name},
         {"position_m", ToJson(X.translation())},
         {"quaternion_wxyz", ToJson(X.quaternion())}});
  }
  out["bases"] = BasesJson(simulation, m);
  out["contacts"] = ContactsJson(simulation, m.statistics.Pairs());
  out["friction_use"] = FrictionUseJson(simulation, m.statistics.BodyFrictions());
  out["joint_gap_max_m"] = m.gap_max;
  out["penetration_max_m"] = m.penetration_max;
  const bool has_load = std::isfinite(m.load_min.factor);
  out["load_factor_min"] = has_load ? Json(m.load_min.factor) : Json(nullptr);
  out["load_factor"] = Json::array();
  for (const Measured::Load& l : m.loads)
    out["load_factor"].push_back({{"time_s", l.time}, {"factor", l.load.factor}, {"body", l.load.body}});
  AddSensors(simulation, out);
  if (m.error) AddErrorFigure(*m.error, out);
  out["step_us"] = {{"median", percentile(0.5)}, {"p99", percentile(0.99)}};
  out["detail"] = Json::array();
  for (const Measured::Switch& s : m.switches)
    out["detail"].push_back({{"time_s", s.time},
                             {"level", Name(s.fidelity.level)},
                             {"modes", s.fidelity.modes >= 0 ? Json(s.fidelity.modes) : Json(nullptr)},
                             {"recovery", Name(s.fidelity.recovery)},
                             {"took_ms", s.ms},
                             {"refused", s.refused.empty() ? Json(nullptr) : Json(s.refused)}});
  // What a contact that pulls uses of its friction has no bound.
  out["hold_use_max"] = m.held && std::isfinite(m.hold_use_max) ? Json(m.hold_use_max) : Json(nullptr);
  out["unconverged_steps"] = m.unconverged;
  const auto or_null = [](const std::string& name) { return name.empty() ? Json(nullptr) : Json(name); };
  const Measured::Stages& stages = m.stages;
  out["halved_steps"] = {{"impact", stages.impacts},         {"impact_of", or_null(stages.impact)},
                         {"saturation", stages.saturations}, {"saturation_of", or_null(stages.saturation)},
                         {"unsolved", stages.unsolved},      {"unsolved_of", or_null(stages.unsolved_of)}};
  out["newton_iterations"] = {{"mean", stages.stages > 0 ? Json(static_cast<double>(stages.iterations) /
                                                                static_cast<double>(stages.stages))
                                                         : Json(nullptr)},
                              {"most", stages.iterations_max},
                              {"residual_max_m", stages.residual_max},
                              {"residual_of", or_null(stages.residual_of)}};
  const auto solves = static_cast<double>(m.solver.solves);
  out["contact_solver"] = {
      {"steps", m.solver.solves},
      {"iterations_mean",
       m.solver.solves > 0 ? Json(static_cast<double>(m.solver.iterations) / solves) : Json(nullptr)},
      {"iterations_max", m.solver.iterations_max},
      {"helped_steps", m.solver.helped},
      {"bearing_max", m.solver.active_max},
      {"sliding_max", m.solver.sliding_max},
      {"residual_max_N", m.solver.force_max},
      {"residual_max_m_s", m.solver.speed_max}};
  out["refreshes"] = m.refreshes;
  out["expansions"] = m.expansions;
  out["expanded_steps"] = m.expanded_steps;
  for (std::size_t i = 0; i < m.refreshes_by_cause.size(); ++i) {
    const RelinearizationTotal& total = m.refreshes_by_cause[i];
    const bool any = total.count > 0;
    out["refreshes_by_cause"][kDriftCauseNames[i]] = {
        {"count", total.count},
        {"largest", any ? Json(total.largest.amount) : Json(nullptr)},
        {"unit", any ? Json(total.largest.is_angle ? "rad" : "m") : Json(nullptr)},
        {"of", or_null(total.of)}};
  }
  out["servos_at_limit"] = {
      {"steps", m.steps_at_bound}, {"most", m.most_at_bound}, {"which", EndsJson(m.statistics.Servos())}};
  out["stops_reached"] = EndsJson(m.statistics.Stops());
  out["stops_passed"] = Json::array();
  const std::vector<StopPassed> stops_passed = m.statistics.PassedStops();
  for (const StopPassed& s : stops_passed)
    out["stops_passed"].push_back({{"name", s.name},
                                   {"end", s.upper ? "upper" : "lower"},
                                   {"beyond_max", s.beyond},
                                   {"unit", s.turns ? "rad" : "m"},
                                   {"beyond_max_s", s.when},
                                   {"first_s", s.first}});
  out["speed_limits_passed"] = Json::array();
  for (const auto& [joint, s] : m.speeding)
    out["speed_limits_passed"].push_back({{"joint", joint},
                                          {"limit", s.limit},
                                          {"speed_max", s.speed},
                                          {"unit", s.turns ? "rad/s" : "m/s"},
                                          {"speed_max_s", s.when},
                                          {"first_s", s.first}});
  out["passed_through"] = Json::array();
  for (const Interpenetration& p : m.passed)
    out["passed_through"].push_back({{"body", p.body},
                                     {"other", p.other},
                                     {"first_s", p.first},
                                     {"depth_max_m", p.depth},
                                     {"depth_max_s", p.when}});
  Json warnings = Json::array();
  for (const std::string& w : simulation.warnings()) warnings.push_back(w);
  if (m.contacts_dropped) warnings.push_back("the collision detector ran out of room and dropped contacts");
  for (const std::string& w : m.implausible) warnings.push_back(w);
  constexpr std::size_t kTold = 5;  // the farthest; the others stand in `stops_passed`
  for (std::size_t i = 0; i < std::min(kTold, stops_passed.size()); ++i) {
    const StopPassed& s = stops_passed[i];
    warnings.push_back(fmt::format(
        "{} was {:.3g} {} beyond its {} stop at {:.4g} s, more than {:.0f} % of its range", s.name, s.beyond,
        s.turns ? "rad" : "m", s.upper ? "upper" : "lower", s.when, 100 * StopPassed::kShareBeyond));
  }
  if (stops_passed.size() > kTold)
    warnings.push_back(fmt::format("{} more joints were beyond their stops", stops_passed.size() - kTold));
  if (!m.speeding.empty()) {
    const auto by_share = [](const auto& a, const auto& b) {
      return a.second.speed / a.second.limit < b.second.speed / b.second.limit;
    };
    const auto& [joint, s] = *std::max_element(m.speeding.begin(), m.speeding.end(), by_share);
    warnings.push_back(fmt::format(
        "joint '{}' moved at {:.3g} {} at {:.4g} s, its file allows {:.3g}{}: no drive here keeps to that by itself",
        joint, s.speed, s.turns ? "rad/s" : "m/s", s.when, s.limit,
        m.speeding.size() == 1 ? ""
                               : fmt::format("; {} more joints passed theirs (speed_limits_passed of --json)",
                                             m.speeding.size() - 1)));
  }
  for (const std::string& w :
       Sentences(m.passed, "add it to --interface, or let all bodies touch by --detail all"))
    warnings.push_back(w);
  if (m.error)
    for (const std::string& w : m.error->Warnings()) warnings.push_back(w);
  if (m.failed_refreshes > 0)
    warnings.push_back(fmt::format("{} refreshes found no reduced model at their pose and kept the old one",
                                   m.failed_refreshes));
  if (m.load_min.factor < 1.3)  // springs and radii of a real hand are hardly known better than to a third
    warnings.push_back(
        fmt::format("load factor {:.3g} at {:.4g} s: '{}' is ejected if contact forces grow to "
                    "that multiple; press less or grasp stiffer",
                    m.load_min.factor, m.load_min_time, m.load_min.body));
  for (const Measured::Switch& s : m.switches)
    if (!s.refused.empty())
      warnings.push_back(fmt::format("at {:.4g} s the detail stayed as it was: {}", s.time, s.refused));
  if (m.held && m.hold_use_max > 1)
    warnings.push_back(
        std::isfinite(m.hold_use_max)
            ? fmt::format(
                  "a frozen contact needs {:.3g} times the friction it has: not frozen, it would slip",
                  m.hold_use_max)
            : std::string("a frozen contact pulls at what it holds: not frozen, it would part"));
  out["warnings"] = std::move(warnings);
  return out;
}

namespace {

void PrintBases(const Json& bases) {
  for (std::size_t i = 0; i < std::min(kLines, bases.size()); ++i) {
    const Json& b = bases[i];
    const Json& q = b["quaternion_wxyz"];
    const Eigen::Quaterniond turn(q[0].get<double>(), q[1].get<double>(), q[2].get<double>(),
                                  q[3].get<double>());
    const double tilt = std::acos(std::clamp((turn * Vector3::UnitZ()).z(), -1.0, 1.0));
    const Json& p = b["position_m"];
    PrintText(
        "  base {:<10} at ({:.5f}, {:.5f}, {:.5f}) m, its z axis {:.3g} degrees from the vertical, velocity "
        "{} m/s, {} rad/s; path {:.4g} m from ({:.5f}, {:.5f}, {:.5f}) m, {:.3g} m/s at most\n",
        b["body"].get<std::string>(), p[0].get<double>(), p[1].get<double>(), p[2].get<double>(),
        tilt * 57.29577951308232, VectorText(b["velocity_m_per_s"]),
        VectorText(b["angular_velocity_rad_per_s"]), b["path_m"].get<double>(), b["start_m"][0].get<double>(),
        b["start_m"][1].get<double>(), b["start_m"][2].get<double>(), b["speed_max_m_per_s"].get<double>());
  }
  PrintOmitted(bases.size(), "bases");
}

void PrintEnds(const Json& ends, const char* where) {
  for (std::size_t i = 0; i < std::min(kLines, ends.size()); ++i) {
    const Json& e = ends[i];
    const std::string end = e["end"] == "both" ? "upper and lower" : e["end"].get<std::string>();
    PrintText("    {} at its {} {}, {} steps from {:.4g} s to {:.4g} s\n", e["name"].get<std::string>(), end,
              where, e["steps"].get<std::int64_t>(), e["first_s"].get<double>(), e["last_s"].get<double>());
  }
  PrintOmitted(ends.size(), "of them");
}

// A handful of moments of its course.
void PrintLoadFactor(const Json& d) {
  if (d["load_factor_min"].is_null()) return;
  PrintText("  load factor     {:.3f} at least", d["load_factor_min"].get<double>());
  const Json& course = d["load_factor"];
  constexpr std::size_t kMoments = 6;
  const std::size_t stride = std::max<std::size_t>(1, (course.size() + kMoments - 1) / kMoments);
  for (std::size_t i = 0; i < course.size() && course.size() > 1; i += stride)
    PrintText("{} {:.3g} at {:.3g} s", i == 0 ? ":" : ",", course[i]["factor"].get<double>(),
              course[i]["time_s"].get<double>());
  PrintText("\n");
}

}  // namespace

void PrintSummary(const Json& d) {
  auto number = [&](const char* key) { return d[key].get<double>(); };
  PrintText("{} steps of {:.6g} s by {}: {:.4g} s simulated in {:.4g} s ({:.1f} times real time)\n",
            d["steps"].get<std::size_t>(), number("dt_s"), d["integrator"].get<std::string>(),
            number("simulated_s"), number("wall_s"),
            d["real_time_factor"].is_null() ? 0.0 : number("real_time_factor"));
  PrintText("  step            {:.1f} us median, {:.1f} us at the 99th percentile\n",
            d["step_us"]["median"].get<double>(), d["step_us"]["p99"].get<double>());
  PrintText("  contacts        {} at most, penetration {:.4f} mm at most, {} steps not converged\n",
            d["contacts_max"].get<int>(), 1e3 * number("penetration_max_m"),
            d["unconverged_steps"].get<int>());
  if (const Json& newton = d["newton_iterations"]; !newton["mean"].is_null()) {
    PrintText("  stages          {:.2f} Newton iterations each, {} at most, residual {:.2g} mm at most\n",
              newton["mean"].get<double>(), newton["most"].get<int>(),
              1e3 * newton["residual_max_m"].get<double>());
    for (const char* cause : {"impact", "saturation", "unsolved"})
      if (const int steps = d["halved_steps"][cause].get<int>(); steps > 0)
        PrintText("  halved          {} steps, {}, {}\n", steps,
                  cause == std::string("impact")       ? "in which something was met"
                  : cause == std::string("saturation") ? "in which a force came to its limit or from it"
                                                       : "whose stages did not converge",
                  d["halved_steps"][std::string(cause) + "_of"].get<std::string>());  // each cause has a name
  }
  const Json& e = d["energy_J"];
  PrintText(
      "  energy          {:.6g} J at the start, {:.6g} J at the end, largest rise in a step {:.3g} J, {:.3g} "
      "J lost to "
      "friction\n",
      e["first"].get<double>(), e["last"].get<double>(), e["max_increase"].get<double>(),
      e["friction_loss"].get<double>());
  PrintText("  joint gap       {:.3g} mm at most\n", 1e3 * number("joint_gap_max_m"));
  PrintText("  refreshes       {}\n", d["refreshes"].get<int>());
  constexpr const char* kCauses[] = {"since a joint had turned, by", "for a load without a column, missing",
                                     "since a loop had opened, by"};
  for (std::size_t i = 0; i < std::size(kCauses); ++i)
    if (const Json& cause = d["refreshes_by_cause"][kDriftCauseNames[i]]; cause["count"].get<int>() > 0)
      PrintText("    {} {} {:.3g} {} at most, {}\n", cause["count"].get<int>(), kCauses[i],
                cause["largest"].get<double>(), cause["unit"].get<std::string>(),
                cause["of"].get<std::string>());
  if (const int steps = d["expanded_steps"].get<int>(); steps > 0)
    PrintText("  expansions      {}; {} steps by them, the others by exact poses\n",
              d["expansions"].get<int>(), steps);
  if (const Json& servos = d["servos_at_limit"]; servos["steps"].get<int>() > 0)
    PrintText("  servos          {} at most at the limit of their force, in {} steps\n",
              servos["most"].get<int>(), servos["steps"].get<int>());
  PrintEnds(d["servos_at_limit"]["which"], "limit of force");
  if (!d["stops_reached"].empty()) PrintText("  stops\n");
  PrintEnds(d["stops_reached"], "stop");
  for (const Json& s : d["detail"])
    if (s["refused"].is_null() && s["time_s"].get<double>() > 0)
      PrintText("  detail          {} from {:.4g} s on, changed in {:.2f} ms\n",
                s["level"].get<std::string>(), s["time_s"].get<double>(), s["took_ms"].get<double>());
  if (!d["hold_use_max"].is_null())
    PrintText("  frozen contacts use {:.2f} of their friction at most\n", number("hold_use_max"));
  PrintLoadFactor(d);
  if (d.contains("accuracy")) PrintAccuracy(d["accuracy"]);
  if (d.contains("error_estimate_mm")) PrintErrorFigure(d);
  PrintFrictionUse(d["friction_use"]);
  PrintContacts(d["contacts"]);
  PrintBases(d["bases"]);
  for (const char* kind : {"interface", "free_bodies"})
    for (const Json& b : d[kind]) {
      const Json& p = b["position_m"];
      PrintText("  {:<15} at ({:.5f}, {:.5f}, {:.5f}) m\n", b["body"].get<std::string>(), p[0].get<double>(),
                p[1].get<double>(), p[2].get<double>());
    }
  for (const Json& w : d["warnings"]) PrintText("  warning: {}\n", w.get<std::string>());
}

}  // namespace fork1s::app
