// A step of a mechanism, by whatever rule: docs/method.md, section 5.
#include <fork1s/dynamics/mechanism_dynamics.hpp>

namespace fork1s {

void MechanismDynamics::Predict(double h, const Vector3& gravity_W) {
  pushed_ = false;
  if (options_.recovery == Recovery::kTwist) {
    PredictTwist(h, gravity_W);
    return;
  }
  TakeMomenta();
  TakeForces(h);
  SolveFree(h);
}

// x* from the forces and momenta at hand.
void MechanismDynamics::SolveFree(double h) {
  if (options_.recovery == Recovery::kTwist)
    SolveFreeTwist(h);
  else if (rule_ == StepRule::kMiddle)
    SolveFreeMiddle(h);
  else
    SolveFreeTwoSteps(h);
}

void MechanismDynamics::PredictAgain(double h) {
  pushed_ = false;
  SolveFree(h);
}

void MechanismDynamics::ApplyImpulse(const VectorX& p, bool from_outside) {
  if (p.isZero(0)) return;
  pushed_ = pushed_ || from_outside;
  rhs_ = p;
  factor_.SolveInPlace(rhs_);
  x_ += rhs_;
  impulse_ += p;
}

void MechanismDynamics::Integrate(double h) {
  if (options_.recovery == Recovery::kTwist)
    IntegrateTwist(h);
  else if (rule_ == StepRule::kMiddle)
    IntegrateMiddle(h);
  else
    IntegrateTwoSteps(h);
  rule_ = StepRule::kEuler;
  order_ = 1;
}

}  // namespace fork1s
