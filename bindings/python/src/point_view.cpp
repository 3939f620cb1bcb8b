#include "point_view.hpp"

#include <fork1s/reduction/frequencies.hpp>

#include "errors.hpp"

namespace fork1s::python {

StiffnessView PointView::Loaded() const { return ValueOrThrow(loaded, file); }

PointView MeasureStiffness(const MechanismView& view, const NamedPoint& point, const Vector3& gravity_W,
                           bool lock_free) {
  const Mechanism& m = view.mechanism();
  std::vector<int> locked;
  if (lock_free) {
    std::vector<BodyIndex> bodies = view.FindBodies({});
    bodies.push_back(m.FindBody(point.body));
    locked = view.CoordinatesToLock(bodies, true);
  }
  auto state = ComputeLoadedState(view.posed(), {}, gravity_W, locked);
  MeasuredPoint measured = MeasurePoint(view.posed(), point, locked, state ? &*state : nullptr);
  PointView out;
  out.point = point;
  out.reference_W = measured.reference_W;
  out.springs = {std::move(measured.springs), FullFrequencies(m, view.posed().q), true};
  if (state)
    out.loaded = StiffnessView{std::move(*measured.loaded), state->modes.hertz, state->tangent.IsStable()};
  else
    out.loaded = tl::unexpected(state.error());
  out.file = view.model->origin();
  for (const int i : locked) out.locked.push_back(m.CoordinateName(i));
  return out;
}

std::vector<PointView> PointsOf(const LoadedBody& loaded) {
  std::vector<PointView> all;
  for (const MeasuredPoint& measured : loaded.points) {
    PointView one;
    one.point = measured.point;
    one.reference_W = measured.reference_W;
    one.springs = {measured.springs, loaded.spring_frequencies_hz, true};
    if (measured.loaded) one.loaded = StiffnessView{*measured.loaded, loaded.frequencies_hz, loaded.stable};
    one.locked = loaded.locked;
    all.push_back(std::move(one));
  }
  return all;
}

}  // namespace fork1s::python
