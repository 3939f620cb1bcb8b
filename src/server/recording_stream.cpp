// Recordings as streams, and streams in pages.
#include <algorithm>
#include <cmath>
#include <fork1s/stepping/mechanism_dynamics.hpp>

#include "base/base64.hpp"
#include "byte_writer.hpp"
#include "scene_description.hpp"
#include "server/wire.hpp"

namespace fork1s {
namespace {

using internal::ByteWriter;

constexpr double kFramesPerSecond = 60;

void Append(std::string& out, bool binary, const std::string& message) {
  ByteWriter head;
  head.U32(binary ? 1 : 0);
  head.U32(static_cast<std::uint32_t>(message.size()));
  out += head.Release();
  out += message;
}

RigidTransform PoseFrom(const double* p) {
  return {Quaternion(p[3], p[4], p[5], p[6]), Vector3(p[0], p[1], p[2])};
}

// Maps without reduced coordinates: the frame's corrections then are the joint displacements themselves.
std::string EmptyMaps(const Mechanism& m, std::uint32_t root) {
  ByteWriter out;
  out.U32(static_cast<std::uint32_t>(WireKind::kMaps));
  for (std::uint32_t word : {1u, root, 1u, static_cast<std::uint32_t>(m.num_coordinates()), 0u,
                             static_cast<std::uint32_t>(m.num_bodies()), 0u})
    out.U32(word);
  for (int i = 0; i < m.num_coordinates(); ++i) out.F64(0);
  out.U32(0);
  return out.Release();
}

class FrameOfRecording {
 public:
  FrameOfRecording(const Recording& recording, const Simulation& simulation, bool separate)
      : recording_(recording), simulation_(simulation), separate_(separate) {}

  std::string Encode(int step) const {
    const RecordedSteps& d = recording_.data();
    const auto i = static_cast<std::size_t>(step);
    ByteWriter out;
    out.U32(static_cast<std::uint32_t>(WireKind::kFrame));
    out.U32(1);
    out.U32(static_cast<std::uint32_t>(step + 1));
    out.U32(0);
    const double unknown = std::nan("");
    for (double v : {d.time[i], unknown, unknown, static_cast<double>(step + 1), d.kinetic_energy[i],
                     d.potential_energy[i], d.closure_gap[i], d.max_penetration[i], d.residual[i], unknown,
                     unknown, unknown, 1.0, unknown})
      out.F64(v);
    WriteRoots(step, out);
    const std::vector<RecordedContact> contacts = recording_.Contacts(step);
    out.U32(static_cast<std::uint32_t>(contacts.size()));
    for (const RecordedContact& c : contacts) {
      out.I32(c.body_a);
      out.I32(c.body_b);
      for (const Vector3* v : {&c.point, &c.normal, &c.force}) out.Vector(*v);
      out.F32(c.gap);
      out.F32(c.friction);
    }
    const std::vector<AppliedWrench> wrenches = recording_.Wrenches(step);
    out.U32(static_cast<std::uint32_t>(wrenches.size()));
    for (const AppliedWrench& w : wrenches) {
      out.I32(w.body);
      for (const Vector3* v : {&w.point_W, &w.point_W, &w.force_W}) out.Vector(*v);
    }
    const VectorX q = recording_.Coordinates(step);
    out.U32(static_cast<std::uint32_t>(q.size()));
    for (Eigen::Index k = 0; k < q.size(); ++k) out.F32(q(k));
    return out.Release();
  }

 private:
  void WriteRoots(int step, ByteWriter& out) const {
    const auto& mechanisms = simulation_.world().mechanisms();
    const int bodies = static_cast<int>(recording_.bodies().size());
    const int first_free = bodies - static_cast<int>(simulation_.world().free_bodies().size());
    auto write_alone = [&](int body) {
      for (int k = 0; k < 3; ++k) out.U32(0);
      out.Pose(recording_.Pose(step, body));
    };
    if (separate_) {
      out.U32(static_cast<std::uint32_t>(bodies));
      for (int b = 0; b < bodies; ++b) write_alone(b);
      return;
    }
    out.U32(static_cast<std::uint32_t>(mechanisms.size()) + static_cast<std::uint32_t>(bodies - first_free));
    const VectorX q = recording_.Coordinates(step);
    Eigen::Index next = 0;
    for (std::size_t m = 0; m < mechanisms.size(); ++m) {
      const int n = mechanisms[m].mechanism().num_coordinates();
      out.U32(1);
      out.U32(0);
      out.U32(static_cast<std::uint32_t>(n));
      out.Pose(PoseFrom(
          &recording_.data().base_poses[7 * (static_cast<std::size_t>(step) * mechanisms.size() + m)]));
      for (int k = 0; k < n; ++k) out.F32(q(next++));
    }
    for (int b = first_free; b < bodies; ++b) write_alone(b);
  }

  const Recording& recording_;
  const Simulation& simulation_;
  bool separate_;
};

}  // namespace

Expected<std::string> EncodeRecording(const Recording& recording, const std::string& title) {
  const RecordingHeader& h = recording.header();
  if (recording.num_steps() == 0)
    return Fail(ErrorCode::kFormat, h.path, "holds no step, so there is nothing to show");
  SimulationOptions options = h.options;
  options.initial_keyframe = -1;  // only names, trees and shapes are asked of it
  auto simulation = Simulation::Create(h.scene, options);
  if (!simulation) return tl::unexpected(simulation.error());
  if (simulation->bodies().size() != h.bodies.size() ||
      recording.Coordinates(0).size() != static_cast<Eigen::Index>(h.coordinate_names.size()))
    return Fail(ErrorCode::kFormat, h.path,
                "names other bodies or coordinates than its scene has; it is damaged");
  const std::vector<std::uint8_t>& twist = recording.data().recovery;
  const bool separate = std::find(twist.begin(), twist.end(), 1) != twist.end();

  std::string out;
  Append(out, false, EncodeGeometry(*simulation, 1));
  Append(out, true, EncodeMeshes(*simulation));
  nlohmann::json scene = internal::DescribeScene(*simulation, title, 1, 1, separate);
  const auto& mechanisms = simulation->world().mechanisms();
  std::size_t coordinate = 0;
  for (const MechanismDynamics& m : mechanisms)
    for (int i = 0; i < m.mechanism().num_coordinates(); ++i)
      scene["signals"].push_back({{"name", h.coordinate_names[coordinate++]},
                                  {"group", "position"},
                                  {"unit", m.mechanism().Turns(i) ? "rad" : "m"},
                                  {"body", -1}});
  Append(out, false, internal::Dump(scene));
  if (!separate)
    for (std::size_t m = 0; m < mechanisms.size(); ++m)
      Append(out, true, EmptyMaps(mechanisms[m].mechanism(), static_cast<std::uint32_t>(m)));

  const FrameOfRecording frames(recording, *simulation, separate);
  for (std::size_t i : FirstOfEachFrame(recording.data().time, kFramesPerSecond))
    Append(out, true, frames.Encode(static_cast<int>(i)));
  return out;
}

std::string ReplayPage(std::string_view page, std::string_view stream) {
  std::string text;
  text.reserve(page.size() + stream.size() * 4 / 3 + 128);
  // The end of the body is the last of that name: the program in the page's head may mention it too.
  const std::size_t end = std::min(page.rfind("</body>"), page.size());
  text += page.substr(0, end);
  text += "<script type=\"text/plain\" id=\"fork1s-recording\">";
  AppendBase64(stream, text);
  text += "</script>\n";
  text += page.substr(end);
  return text;
}

}  // namespace fork1s
