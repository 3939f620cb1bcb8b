#include <fork1s/sim/push.hpp>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <optional>

namespace fork1s {
namespace {

constexpr double kMost = 1e12;  // what is larger is a slip of the pen

// from_chars takes a point whatever the language of the system.
std::optional<double> Number(const std::string& text) {
  const char* first = text.data() + (text.size() > 1 && text[0] == '+' && text[1] != '-' ? 1 : 0);
  double value = 0;
  const auto [end, status] = std::from_chars(first, text.data() + text.size(), value);
  if (status != std::errc() || end != text.data() + text.size()) return std::nullopt;
  if (!(std::abs(value) <= kMost)) return std::nullopt;
  return value;
}

std::optional<std::vector<double>> Numbers(const std::string& text) {
  std::vector<double> out;
  for (std::size_t begin = 0; begin <= text.size();) {
    const auto comma = std::min(text.find(',', begin), text.size());
    const auto value = Number(text.substr(begin, comma - begin));
    if (!value) return std::nullopt;
    out.push_back(*value);
    begin = comma + 1;
  }
  return out;
}

// Cuts "@PX,PY,PZ" off the end, if that is what stands there; names may hold an @.
Vector3 UpdatePoint(std::string& text) {
  const auto at = text.rfind('@');
  if (at == std::string::npos) return Vector3::Zero();
  const auto numbers = Numbers(text.substr(at + 1));
  if (!numbers || numbers->size() != 3) return Vector3::Zero();
  text.erase(at);
  return Vector3((*numbers)[0], (*numbers)[1], (*numbers)[2]);
}

Vector6 RowAt(const Push& push, double time) {
  const auto after = static_cast<std::size_t>(std::upper_bound(push.times.begin(), push.times.end(), time) -
                                              push.times.begin());
  if (after == 0) return push.rows.front();
  if (after == push.times.size()) return push.rows.back();
  const double share = (time - push.times[after - 1]) / (push.times[after] - push.times[after - 1]);
  return push.rows[after - 1] + share * (push.rows[after] - push.rows[after - 1]);
}

// A column "force:BODY:x": which rows of the wrench, of what body and point.
struct Column {
  std::string body;
  Vector3 point_B = Vector3::Zero();
  int row = 0;  // of [moment; force]
};

Expected<Column> ReadColumn(const std::string& name, bool is_force, const std::string& where) {
  auto refuse = [&] {
    return Fail(
        ErrorCode::kFormat, where,
        "column '" + name +
            "' is no push: write force:BODY:x or torque:BODY:x, the axis x, y or z, for a point of the "
            "body \"force:BODY@0,0,0.1:x\" in quotes");
  };
  std::string rest = name.substr(name.find(':') + 1);
  const auto colon = rest.rfind(':');
  if (colon == std::string::npos || colon == 0 || colon + 2 != rest.size()) return refuse();
  const auto axis = std::string("xyz").find(rest[colon + 1]);
  if (axis == std::string::npos) return refuse();
  Column column;
  column.row = static_cast<int>(axis) + (is_force ? 3 : 0);
  column.body = rest.substr(0, colon);
  column.point_B = UpdatePoint(column.body);
  if (column.body.empty()) return refuse();
  return column;
}

}  // namespace

Expected<Push> PushTrack::Parse(const std::string& text, const std::string& option) {
  auto refuse = [&](const std::string& what) {
    return Fail(ErrorCode::kUsage, option,
                what + " in '" + text +
                    "'; it takes BODY:FX,FY,FZ[,MX,MY,MZ][@PX,PY,PZ][:T0..T1] in N, N·m, m and s");
  };
  Push push;
  std::string rest = text;
  const auto last = rest.rfind(':');
  if (last == std::string::npos) return refuse("there is no ':' after the body");
  if (const auto dots = rest.find("..", last); dots != std::string::npos) {
    const std::string from = rest.substr(last + 1, dots - last - 1), to = rest.substr(dots + 2);
    const auto t0 = from.empty() ? 0 : Number(from);
    const auto t1 = to.empty() ? std::numeric_limits<double>::infinity() : Number(to);
    if (!t0 || !t1 || *t0 < 0) return refuse("'" + rest.substr(last + 1) + "' is no span of time");
    if (!(*t1 > *t0)) return refuse("'" + rest.substr(last + 1) + "' ends before it begins");
    push.from = *t0;
    push.to = *t1;
    rest.erase(last);
  }
  push.point_B = UpdatePoint(rest);
  const auto colon = rest.rfind(':');
  if (colon == std::string::npos || colon == 0) return refuse("there is no body before the force");
  const auto numbers = Numbers(rest.substr(colon + 1));
  if (!numbers || (numbers->size() != 3 && numbers->size() != 6))
    return refuse("'" + rest.substr(colon + 1) + "' is not three or six numbers with commas between");
  push.body = rest.substr(0, colon);
  push.force_W = Vector3((*numbers)[0], (*numbers)[1], (*numbers)[2]);
  if (numbers->size() == 6) push.moment_W = Vector3((*numbers)[3], (*numbers)[4], (*numbers)[5]);
  return push;
}

Expected<PushTrack> PushTrack::ExtractFrom(ControlTrack& track, const std::string& where) {
  PushTrack out;
  ControlTrack kept;
  kept.times = track.times;
  kept.rows.resize(track.rows.size());
  for (std::size_t k = 0; k < track.names.size(); ++k) {
    const bool is_force = track.names[k].rfind("force:", 0) == 0;
    if (!is_force && track.names[k].rfind("torque:", 0) != 0) {
      kept.names.push_back(track.names[k]);
      for (std::size_t i = 0; i < track.rows.size(); ++i) kept.rows[i].push_back(track.rows[i][k]);
      continue;
    }
    const auto column = ReadColumn(track.names[k], is_force, where);
    if (!column) return tl::unexpected(column.error());
    auto push = std::find_if(out.pushes.begin(), out.pushes.end(), [&](const Push& p) {
      return p.body == column->body && p.point_B == column->point_B;
    });
    if (push == out.pushes.end()) {
      Push fresh;
      fresh.body = column->body;
      fresh.point_B = column->point_B;
      fresh.times = track.times;
      fresh.rows.assign(track.times.size(), Vector6::Zero());
      push = out.pushes.insert(out.pushes.end(), std::move(fresh));
    }
    for (std::size_t i = 0; i < track.rows.size(); ++i) push->rows[i](column->row) += track.rows[i][k];
  }
  track = std::move(kept);
  return out;
}

std::vector<std::string> PushTrack::FindMissing(const Simulation& simulation) const {
  std::vector<std::string> missing;
  for (const Push& p : pushes)
    if (simulation.FindBody(p.body) < 0) missing.push_back(p.body);
  return missing;
}

std::vector<PushNow> PushTrack::Over(double end, double h, const Simulation& simulation) const {
  std::vector<PushNow> out;
  for (const Push& p : pushes) {
    PushNow now;
    now.body = simulation.FindBody(p.body);
    if (now.body < 0) continue;
    if (p.times.empty()) {
      double share = std::clamp((std::min(end, p.to) - std::max(end - h, p.from)) / h, 0.0, 1.0);
      constexpr double kRounding = 1e-9;  // of times that are multiples of the step
      if (share < kRounding) share = 0;
      if (share > 1 - kRounding) share = 1;
      now.force_W = share * p.force_W;
      now.moment_W = share * p.moment_W;
    } else {
      const Vector6 wrench = RowAt(p, end);
      now.moment_W = wrench.head<3>();
      now.force_W = wrench.tail<3>();
    }
    if (now.force_W.isZero(0) && now.moment_W.isZero(0)) continue;
    now.point_B = p.point_B;
    now.point_W = simulation.Pose(now.body) * p.point_B;
    out.push_back(now);
  }
  return out;
}

}  // namespace fork1s
