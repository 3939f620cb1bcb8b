#include "conversion.hpp"

#include <cmath>

#include <fmt/format.h>

#include "names.hpp"

namespace fork1s::internal {

std::string NameOr(const mjModel& m, int address, const char* kind, int id) {
  const char* name = m.names + address;
  return *name != '\0' ? std::string(name) : fmt::format("{}{}", kind, id);
}

void Conversion::Note(ImportNote::Kind kind, std::string where, std::string message) {
  report.notes.push_back({kind, std::move(where), std::move(message)});
}

void Conversion::NoteMany(ImportNote::Kind note, const std::string& kind,
                          const std::vector<std::string>& names, const std::string& message) {
  if (names.empty()) return;
  if (names.size() == 1) {
    Note(note, fmt::format("{} '{}'", kind, names[0]), message);
    return;
  }
  Note(note, fmt::format("{} x {}", names.size(), kind), fmt::format("{}: {}", Quoted(names), message));
}

RigidTransform Conversion::WorldPose(int b) const {
  const mjtNum *p = d.xpos + 3 * b, *q = d.xquat + 4 * b;
  return {Quaternion(q[0], q[1], q[2], q[3]), Vector3(p[0], p[1], p[2])};
}

int Conversion::MechanismOf(int dof) const { return joint[m.dof_jntid[dof]].mechanism; }

FreedomRef Conversion::Freedom(int dof) const {
  const int j = m.dof_jntid[dof], i = dof - m.jnt_dofadr[j];
  if (m.jnt_type[j] == mjJNT_FREE && i >= 3) return {JointIndex(joint[j].joint.value() + 1), i - 3};
  return {joint[j].joint, i};
}

FreedomDef& Conversion::FreedomOf(int dof) {
  const FreedomRef ref = Freedom(dof);
  return scene.mechanisms[MechanismOf(dof)].joints[ref.joint.u()].freedoms[ref.freedom];
}

std::string Conversion::DofName(int dof) const {
  const int j = m.dof_jntid[dof];
  if (m.jnt_type[j] == mjJNT_HINGE || m.jnt_type[j] == mjJNT_SLIDE) return joint_names[j];
  static const char* const kAxes[] = {"x", "y", "z", "rx", "ry", "rz"};
  const int i = dof - m.jnt_dofadr[j];
  return fmt::format("{}.{}", joint_names[j], kAxes[m.jnt_type[j] == mjJNT_FREE ? i : i + 3]);
}

double Conversion::Reference(int dof) const {
  const int j = m.dof_jntid[dof];
  const bool scalar = m.jnt_type[j] == mjJNT_HINGE || m.jnt_type[j] == mjJNT_SLIDE;
  return scalar ? m.qpos0[m.jnt_qposadr[j]] : 0;
}

const char* Conversion::StiffnessUnit(int dof) const {
  const int j = m.dof_jntid[dof];
  const bool translates =
      m.jnt_type[j] == mjJNT_SLIDE || (m.jnt_type[j] == mjJNT_FREE && dof < m.jnt_dofadr[j] + 3);
  return translates ? "N/m" : "N·m/rad";
}

Anchor AnchorIn(const Conversion& c, int mechanism, int b) {
  const BodyPlace& place = c.body[b];
  if (place.mechanism == mechanism) return {place.body, RigidTransform()};
  return {BodyIndex(0), c.scene.mechanisms[mechanism].X_WR.inverse() * c.WorldPose(b)};
}

EqualityPlace PlaceOfEquality(const mjModel& m, int e, int which) {
  const int object = which == 0 ? m.eq_obj1id[e] : m.eq_obj2id[e];
  if (!HoldsSites(m, e)) return {object, RigidTransform()};
  return {m.site_bodyid[object],
          RigidTransform(Quat(m.site_quat + 4 * object), Vec3(m.site_pos + 3 * object))};
}

bool Conversion::IsActive(int e) const {
  return m.eq_active0[e] && !switched_by_name[e] &&
         !(m.opt.disableflags & (mjDSBL_EQUALITY | mjDSBL_CONSTRAINT));
}

bool Conversion::IsSwitchable(int e) const {
  return (!m.eq_active0[e] || switched_by_name[e]) && m.names[m.name_eqadr[e]] != '\0' &&
         (m.eq_type[e] == mjEQ_CONNECT || m.eq_type[e] == mjEQ_WELD) &&
         !(m.opt.disableflags & (mjDSBL_EQUALITY | mjDSBL_CONSTRAINT));
}

bool Conversion::EqualityWorks(int e) const {
  if (!IsActive(e)) return false;
  if (m.eq_type[e] == mjEQ_CONNECT || m.eq_type[e] == mjEQ_WELD) return true;
  const auto joints = JointEqualityOf(*this, e);
  return joints && joints->a >= 0;
}

Error Conversion::ModelError(const std::string& where, const std::string& message) const {
  return {ErrorCode::kModel, where.empty() ? file : fmt::format("{}, {}", file, where), message};
}

}  // namespace fork1s::internal
