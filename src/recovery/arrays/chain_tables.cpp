#include "chain_tables.hpp"

#include <cmath>
#include <limits>

namespace fork1s::internal {
namespace {

void Append(const RigidTransform& X, std::vector<double>& out) {
  for (int i = 0; i < 9; ++i) out.push_back(X.rotation()(i / 3, i % 3));
  for (int i = 0; i < 3; ++i) out.push_back(X.translation()(i));
}

// A_0 to a_3 of a screw [ω; v], |ω| = 1 or 0, behind a pose C.
struct ScrewConstants {
  LinkKind kind;
  std::vector<double> values;
  std::array<double, 9> screw{};

  void PutScrew(const Vector3& w, const Vector3& wv, const Vector3& slide) {
    for (int i = 0; i < 3; ++i) {
      screw[static_cast<std::size_t>(i)] = w(i);
      screw[static_cast<std::size_t>(3 + i)] = wv(i);
      screw[static_cast<std::size_t>(6 + i)] = slide(i);
    }
  }

  ScrewConstants(const RigidTransform& C, const Vector3& w, const Vector3& v) {
    Append(C, values);
    if (w.isZero(0)) {
      kind = LinkKind::kSlide;
      PutScrew(w, w, v);
      const Vector3 slide = C.rotation() * v;
      values.insert(values.end(), slide.data(), slide.data() + 3);
      return;
    }
    const Matrix3 W = Skew(w);
    const Vector3 wv = w.cross(v);
    Append({Matrix3(C.rotation() * W), Vector3(-(C.rotation() * w.cross(wv)))}, values);
    Append({Matrix3(C.rotation() * W * W), Vector3(C.rotation() * wv)}, values);
    // A hinge's v is ω x its place: what is left of ω·v is rounding.
    const double pitch = w.dot(v);
    kind = std::abs(pitch) <= 4 * std::numeric_limits<double>::epsilon() * v.norm() ? LinkKind::kTurn
                                                                                    : LinkKind::kScrew;
    PutScrew(w, wv, kind == LinkKind::kTurn ? Vector3(Vector3::Zero()) : Vector3(pitch * w));
    if (kind == LinkKind::kTurn) return;
    const Vector3 slide = C.rotation() * (pitch * w);
    values.insert(values.end(), slide.data(), slide.data() + 3);
  }
};

// Unit of the angle of a link of one freedom: its weights are those of the coordinate times |ω|.
double TurnPerCoordinate(const Vector6& screw) {
  const double turn = screw.head<3>().norm();
  return turn > 0 ? turn : 1;
}

}  // namespace

CoordinateForms::CoordinateForms(const ReducedModel& model, const VectorX& unit)
    : forms_(static_cast<std::size_t>(model.num_coordinates())), size_(1 + model.size() + model.loop_rank()) {
  const int r = model.size();
  for (int i = 0; i < model.num_coordinates(); ++i) {
    std::vector<Term>& form = forms_[static_cast<std::size_t>(i)];
    form.emplace_back(0, model.q_ref(i));
    for (int k = 0; k < r; ++k)
      if (model.Q(i, k) != 0) form.emplace_back(1 + k, model.Q(i, k));
  }
  VectorX one = VectorX::Zero(model.loop_rank()), column(model.num_coordinates());
  for (int row = 0; row < model.loop_rank(); ++row) {
    one(row) = unit(row);
    column.setZero();
    model.loops.SubtractTransposed(model.B, one, column);
    one(row) = 0;
    for (int i = 0; i < column.size(); ++i)
      if (column(i) != 0) forms_[static_cast<std::size_t>(i)].emplace_back(1 + r + row, column(i));
  }
}

LinkTables<double> MakeLinks(const Mechanism& mechanism, const CoordinateForms& forms) {
  LinkTables<double> out;
  auto& [links, inputs, weights, constants, screws, slots] = out;
  const auto& bodies = mechanism.bodies();
  const auto& joints = mechanism.joints();
  slots = mechanism.num_bodies();
  std::vector<int> slot_of_joint(joints.size());
  const auto add = [&](Link link, const std::vector<double>& values) {
    link.constants = constants.size();
    constants.insert(constants.end(), values.begin(), values.end());
    link.last = static_cast<int>(inputs.size());
    links.push_back(link);
    screws.push_back({});
  };
  const auto begin = [&](int previous, int slot) {
    Link link;
    link.slot = slot;
    link.parent = previous < 0 ? -1 : slot_of_joint[static_cast<std::size_t>(previous)];
    link.first = static_cast<int>(inputs.size());
    link.weights = weights.size();
    return link;
  };
  const auto frame = [&](int joint) {
    return joint < 0 ? RigidTransform() : bodies[joints[static_cast<std::size_t>(joint)].body.u()].X_RB0;
  };
  const auto add_input = [&](const CoordinateForms::Term& term) { inputs.push_back(term.first); };

  std::size_t j = 0;
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    const RigidTransform& X_RB0 = bodies[b].X_RB0;
    if (j == joints.size() || joints[j].body.u() != b) {  // welded to what carries it
      const int last = bodies[b].last_joint;
      std::vector<double> values;
      Append(frame(last).inverse() * X_RB0, values);
      add(begin(last, static_cast<int>(b)), values);
    }
    for (; j < joints.size() && joints[j].body.u() == b; ++j) {
      const Mechanism::Joint& joint = joints[j];
      const bool is_last = j + 1 == joints.size() || joints[j + 1].body.u() != b;
      slot_of_joint[j] = is_last ? static_cast<int>(b) : slots++;
      Link link = begin(joint.previous, slot_of_joint[j]);
      const RigidTransform C = frame(joint.previous).inverse() * X_RB0;
      const auto& freedoms = mechanism.definition().joints[j].freedoms;
      if (joint.size == 1) {
        const Vector6& s = freedoms[0].screw_B;
        const double turn = TurnPerCoordinate(s);
        const ScrewConstants screw(C, s.head<3>() / turn, s.tail<3>() / turn);
        for (const auto& term : forms.of(joint.offset)) {
          add_input(term);
          weights.push_back(turn * term.second);
        }
        link.kind = screw.kind;
        add(link, screw.values);
        screws.back() = screw.screw;
        continue;
      }
      // Exp(x) behind C is Exp(Ad(C) x) before it; every entry of y that any of its freedoms depends on.
      std::vector<Vector6> of_entry(static_cast<std::size_t>(forms.size()), Vector6::Zero());
      std::vector<bool> is_heard(of_entry.size(), false);
      is_heard[0] = true;
      for (int f = 0; f < joint.size; ++f) {
        const Vector6 s = AdjointApply(C, freedoms[static_cast<std::size_t>(f)].screw_B);
        for (const auto& [entry, weight] : forms.of(joint.offset + f)) {
          of_entry[static_cast<std::size_t>(entry)] += weight * s;
          is_heard[static_cast<std::size_t>(entry)] = true;
        }
      }
      for (std::size_t entry = 0; entry < of_entry.size(); ++entry) {
        if (!is_heard[entry]) continue;
        inputs.push_back(static_cast<int>(entry));
        weights.insert(weights.end(), of_entry[entry].data(), of_entry[entry].data() + 6);
      }
      link.kind = LinkKind::kTwist;
      std::vector<double> values;
      Append(C, values);
      add(link, values);
    }
  }
  return out;
}

// Two a weight; of turns two for each entry of A_1 and A_2 and some thirty to sixty for sine and cosine, of
// twists those of twist_kernels-inl.hpp; a product of poses 63.
std::size_t LinkOperations(const std::vector<Link>& links, std::size_t weights, std::size_t bytes) {
  const std::size_t series = 2 * 2 * (bytes == 4 ? 5 : 9) + 14,
                    far_series = 2 * 2 * (bytes == 4 ? 7 : 12) + 121;
  std::size_t sum = 2 * weights;
  for (const Link& link : links) {
    if (link.parent >= 0) sum += 63;
    if (link.kind == LinkKind::kTurn || link.kind == LinkKind::kScrew) sum += series + 48;
    if (link.kind == LinkKind::kSlide || link.kind == LinkKind::kScrew) sum += 6;
    if (link.kind == LinkKind::kTwist) sum += far_series;
  }
  return sum;
}

}  // namespace fork1s::internal
