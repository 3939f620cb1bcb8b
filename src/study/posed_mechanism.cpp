#include <fmt/format.h>
#include <algorithm>

#include <fork1s/mechanism/kinematics.hpp>

#include "mechanism/activation.hpp"
#include "study/posed_mechanism.hpp"

namespace fork1s {

Expected<std::vector<PosedMechanism>> PoseMechanisms(const ImportedScene& imported) {
  std::vector<PosedMechanism> posed;
  for (std::size_t i = 0; i < imported.scene.mechanisms.size(); ++i) {
    auto built = BuildMechanism(imported.scene.mechanisms[i]);
    if (!built) return tl::unexpected(built.error());
    PosedMechanism p;
    p.mechanism = std::make_shared<const Mechanism>(std::move(*built));
    p.interfaces_chosen = imported.scene.mechanisms[i].interfaces_chosen;
    const MechanismDef& def = p.mechanism->definition();
    p.X_WR = def.X_WR;
    p.loads.controls.resize(static_cast<Eigen::Index>(def.controls.size()));
    for (std::size_t k = 0; k < def.controls.size(); ++k)
      p.loads.controls(static_cast<Eigen::Index>(k)) = internal::RestingActivation(def.controls[k]);
    p.q = VectorX::Zero(p.mechanism->num_coordinates());
    if (imported.initial_keyframe >= 0) {
      const auto& start =
          imported.scene.keyframes[static_cast<std::size_t>(imported.initial_keyframe)].mechanisms[i];
      p.q = start.q;
      p.X_WR = start.X_WR;
    }
    p.loads.gravity_R = p.X_WR.rotation().transpose() * imported.scene.gravity;
    const double gap = CloseLoops(*p.mechanism, p.q);
    if (gap > 1e-6)
      return Fail(
          ErrorCode::kModel, fmt::format("mechanism '{}'", p.mechanism->name()),
          fmt::format("has loops that stay open by {:.3g} m; correct the closure frames or choose another "
                      "keyframe",
                      gap));
    posed.push_back(std::move(p));
  }
  return posed;
}

Expected<ReducedModel> ReduceAtStart(const PosedMechanism& posed, const std::vector<BodyIndex>& interfaces) {
  ReductionOptions options;
  options.interfaces = interfaces;
  options.promote_hidden = interfaces.empty() && !posed.interfaces_chosen;
  options.step = Scene().timestep;
  return Reduce(posed.mechanism, posed.q, options, &posed.loads);
}

const PosedMechanism* FindMechanism(const std::vector<PosedMechanism>& posed, const std::string& body) {
  const auto it = std::find_if(posed.begin(), posed.end(),
                               [&](const PosedMechanism& p) { return p.mechanism->FindBody(body).valid(); });
  return it == posed.end() ? nullptr : &*it;
}

}  // namespace fork1s
