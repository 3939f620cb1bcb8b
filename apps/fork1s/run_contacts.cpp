#include "run_contacts.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "print.hpp"

namespace fork1s::app {
namespace {

std::string NameOf(const Simulation& simulation, int body) {
  return body < 0 ? "world" : simulation.bodies()[static_cast<std::size_t>(body)].name;
}

// What uses of its friction has no bound where it pulls (frozen contacts), and no meaning without friction.
Json UseJson(double use, const ContactLoad& load) {
  return load.friction_limit > 0 && std::isfinite(use) ? Json(use) : Json(nullptr);
}

Json LoadJson(const ContactLoad& load) {
  return {{"force_N", ToJson(load.force_W)},
          {"moment_Nm", ToJson(load.moment_W)},
          {"normal_N", load.normal},
          {"tangential_N", load.tangential},
          {"friction_use", UseJson(load.FrictionUse(), load)}};
}

void PrintLoad(const std::string& when, const Json& load) {
  constexpr double kRounding = 1e-6;  // m: a lever arm that is none
  double size = 0;
  for (const Json& x : load["force_N"]) size = std::hypot(size, x.get<double>());
  const double tangential = load["tangential_N"].get<double>();
  PrintText("      {:<16} {} N, {} N m; normal {:.3g} N, tangential {:.3g} N\n", when,
            VectorText(load["force_N"]), VectorText(load["moment_Nm"], kRounding * size),
            load["normal_N"].get<double>(), tangential > 1e-3 * kRounding * size ? tangential : 0.0);
}

// The body of the two that stayed while the other slid over it; null where both moved, nothing slid, or it is the world.
Json StayedOf(const Simulation& simulation, const PairLoad& p) {
  constexpr double kStays = 0.1;  // of the way of the other
  if (p.slip_first < 0 || p.body_a < 0 || p.body_b < 0) return nullptr;
  if (p.way_a <= kStays * p.way_b) return NameOf(simulation, p.body_a);
  if (p.way_b <= kStays * p.way_a) return NameOf(simulation, p.body_b);
  return nullptr;
}

}  // namespace

Json FrictionUseJson(const Simulation& simulation, const std::vector<BodyFriction>& bodies) {
  Json out = Json::array();
  for (const BodyFriction& f : bodies) {
    if (!std::isfinite(f.use_max)) continue;  // frozen contacts that pull
    Json course = Json::array();
    for (const BodyFriction::Moment& m : f.course) course.push_back({{"time_s", m.time}, {"use", m.use}});
    out.push_back({{"body", NameOf(simulation, f.body)},
                   {"mean", f.use_mean},
                   {"max", f.use_max},
                   {"margin_min", 1 - f.use_max},
                   {"margin_min_s", f.use_max_s},
                   {"course", std::move(course)}});
  }
  return out;
}

void PrintFrictionUse(const Json& bodies) {
  for (std::size_t i = 0; i < std::min(kLines, bodies.size()); ++i)
    PrintText("  friction        '{}' uses {:.1f} % on average; least margin {:.1f} %, at {:.4g} s\n",
              bodies[i]["body"].get<std::string>(), 100 * bodies[i]["mean"].get<double>(),
              100 * bodies[i]["margin_min"].get<double>(), bodies[i]["margin_min_s"].get<double>());
  PrintOmitted(bodies.size(), "bodies");
}

Json ContactsJson(const Simulation& simulation, const std::vector<PairLoad>& pairs) {
  Json out = Json::array();
  for (const PairLoad& p : pairs) {
    Json peak = LoadJson(p.peak);
    peak["time_s"] = p.peak_s;
    out.push_back({{"bodies", {NameOf(simulation, p.body_a), NameOf(simulation, p.body_b)}},
                   {"force_N", ToJson(p.last.force_W)},
                   {"moment_Nm", ToJson(p.last.moment_W)},
                   {"force_max_N", p.peak.force_W.norm()},
                   {"force_max_s", p.peak_s},
                   {"peak", std::move(peak)},
                   {"mean", LoadJson(p.mean)},
                   {"friction_use_max", UseJson(p.use_max, p.mean)},
                   {"friction_use_max_s", p.use_max_s},
                   {"normal_max_N", p.normal_max},
                   {"normal_max_s", p.normal_max_s},
                   {"tangential_max_N", p.tangential_max},
                   {"tangential_max_s", p.tangential_max_s},
                   {"touched_s", p.touched_s},
                   {"touched_first_s", p.touched_first},
                   {"touched_last_s", p.touched_last},
                   {"touches_at_end", p.last.force_W.norm() > 0},
                   {"friction_loss_J", p.friction_loss},
                   {"slip_m", p.slip},
                   {"slid_over", StayedOf(simulation, p)},
                   {"slip_s", p.slip_s},
                   {"slip_first_s", p.slip_first < 0 ? Json(nullptr) : Json(p.slip_first)},
                   {"slip_last_s", p.slip_last < 0 ? Json(nullptr) : Json(p.slip_last)}});
  }
  return out;
}

std::string VectorText(const Json& v, double floor) {
  double x[3], most = floor;
  for (std::size_t i = 0; i < 3; ++i) {
    x[i] = v[i].get<double>();
    most = std::max(most, std::abs(x[i]));
  }
  for (double& value : x)
    if (std::abs(value) <= 1e-3 * most) value = 0;
  return fmt::format("({:.3g}, {:.3g}, {:.3g})", x[0], x[1], x[2]);
}

void PrintOmitted(std::size_t count, const char* what) {
  if (count > kLines) PrintText("    {} more {} in --json\n", count - kLines, what);
}

void PrintContacts(const Json& contacts) {
  if (contacts.empty()) return;
  PrintText("  contact by pair of bodies: force and moment on the second about its origin, world axes\n");
  for (std::size_t i = 0; i < std::min(kLines, contacts.size()); ++i) {
    const Json& c = contacts[i];
    const auto number = [&](const char* key) { return c[key].get<double>(); };
    const bool touches = c["touches_at_end"].get<bool>();
    PrintText("    {} on {}: touched for {:.4g} s from {:.4g} s on{}", c["bodies"][0].get<std::string>(),
              c["bodies"][1].get<std::string>(), number("touched_s"), number("touched_first_s"),
              touches ? "" : fmt::format(", last at {:.4g} s", number("touched_last_s")));
    if (const Json& use = c["mean"]["friction_use"]; !use.is_null() && !c["friction_use_max"].is_null())
      PrintText("; uses {:.0f} % of its friction on average, {:.0f} % at most, at {:.4g} s",
                100 * use.get<double>(), 100 * number("friction_use_max"), number("friction_use_max_s"));
    constexpr double kSlipped = 1e-4;  // m
    if (number("slip_m") > kSlipped)
      PrintText("; slipped {:.3g} mm from {:.4g} s to {:.4g} s{}", 1e3 * number("slip_m"),
                number("slip_first_s"), number("slip_last_s"),
                c["slid_over"].is_null()
                    ? ""
                    : fmt::format(", over '{}', which stayed", c["slid_over"].get<std::string>()));
    PrintText("\n");
    PrintLoad(fmt::format("peak, {:.4g} s", c["peak"]["time_s"].get<double>()), c["peak"]);
    PrintLoad("mean", c["mean"]);
    if (touches)
      PrintText("      {:<16} {} N, {} N m\n", "at the end", VectorText(c["force_N"]),
                VectorText(c["moment_Nm"], 1e-6 * number("force_max_N")));
  }
  PrintOmitted(contacts.size(), "pairs");
}

}  // namespace fork1s::app
