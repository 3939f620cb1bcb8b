// A step of a mechanism, by whatever rule: docs/method.md, section 5.
#include <limits>

#include "mechanism_detail.hpp"

namespace fork1s {

void SolveOrFail(Cholesky& factor, const MatrixX& A, VectorX& x) {
  if (factor.Compute(A))
    factor.SolveInPlace(x);
  else
    x.setConstant(std::numeric_limits<double>::quiet_NaN());
}

void Predict(const MechanismStep& here, double h, const Vector3& gravity_W) {
  const auto& [model, state, ws] = here;
  ws.pushed = false;
  if (model.by_twists()) {
    PredictTwist(here, h, gravity_W);
    return;
  }
  TakeMomenta(here);
  TakeForces(here, h);
  SolveFree(here, h);
}

// x* from the forces and momenta at hand.
void SolveFree(const MechanismStep& here, double h) {
  const auto& [model, state, ws] = here;
  if (model.by_twists())
    SolveFreeTwist(here, h);
  else if (ws.rule == StepRule::kMiddle)
    SolveFreeMiddle(here, h);
  else if (ws.rule == StepRule::kStage)
    SolveFreeStage(here, h);
  else
    SolveFreeTwoSteps(here, h);
}

void ExpectContact(const MechanismStep& here, bool touches) { here.work.touches = touches; }

void ActAtEnd(const MechanismStep& here) { here.work.touches = here.work.first_order = true; }

void ForgetPast(const MechanismStep& here) { here.state.past.h = 0; }

const VectorX& ContactShift(const MechanismView& here) { return here.work.contact_shift; }

int NewtonSteps(const MechanismView& here) { return here.work.newton_steps; }

bool FoundMinimum(const MechanismView& here) { return here.work.minimum_found; }

void PredictAgain(const MechanismStep& here, double h) {
  const auto& [model, state, ws] = here;
  ws.pushed = false;
  SolveFree(here, h);
}

void ApplyImpulse(const MechanismStep& here, const VectorX& p, bool from_outside) {
  const auto& [model, state, ws] = here;
  if (p.isZero(0)) return;
  ws.pushed = ws.pushed || from_outside;
  ws.rhs = p;
  ws.factor.SolveInPlace(ws.rhs);
  ws.x += ws.rhs;
  ws.impulse += p;
}

void Integrate(const MechanismStep& here, double h) {
  const auto& [model, state, ws] = here;
  if (model.by_twists())
    IntegrateTwist(here, h);
  else if (ws.rule == StepRule::kMiddle)
    IntegrateMiddle(here, h);
  else
    IntegrateTwoSteps(here, h);
  ws.rule = StepRule::kEuler;
  ws.order = 1;
  state.mu = ws.configuration.mu;
}

}  // namespace fork1s
