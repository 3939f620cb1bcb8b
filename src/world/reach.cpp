// What may be met within a stage: how far contacts and stops are sought, and from which pose.
//
// A stage finds contacts at the pose that its predicted velocity leads to, within a margin. The velocity
// found may lead farther than that, by servos, pushes and impacts of the stage itself, and what is met beyond
// the margin would be passed. So the motion from the pose of detection to the pose found is compared with the
// margin; where it is longer, the iteration is repeated with contacts within that motion.
//
// Contacts of such an iteration are those of the pose where the stage starts, as speculative contacts are (E.
// Catto, GDC 2013): at a pose beyond the middle of a thin body the normal points to the far side. An
// iteration from there is never the last: the next one linearizes at the pose found.
#include <algorithm>

#include "detail.hpp"

namespace fork1s {
// What the predicted motion may have led past is sought from the start of the stage, as far as everything
// moved.
bool World::Detail::MayHavePassed(double h) {
  if (!fork1s::MayHavePassed(Impacts(), h)) return false;
  detection_.WidenToMotion();
  return true;
}

void World::Detail::RecordStageStart(bool of_step) {
  for (MechanismDynamics& m : bodies_.mechanisms) fork1s::RecordStageStart(m, of_step);
  for (FreeBody& body : bodies_.free_bodies) body.RecordStageStart(of_step);
  detection_.RecordStageStart(bodies_);
}

// Contacts at the pose where the stage, of length b, starts.
bool World::Detail::PrepareContactsAtStageStart(const StepOptions& stage, StepReport& report) {
  {
    const PartClock clock(times_, &StepPartTimes::moving);
    bodies_.ForMechanisms([&](std::size_t i) { MoveToStageStart(bodies_.mechanisms[i], stage.h); });
    for (FreeBody& body : bodies_.free_bodies) body.MoveToStageStart(stage.h);
  }
  stage_.rows_from_start = true;
  if (!PrepareContacts(stage, report)) return false;
  bodies_.ForMechanisms([&](std::size_t i) {
    RestoreStageBaseTwist(bodies_.mechanisms[i]);
    EvaluateStage(bodies_.mechanisms[i], stage.h);
  });
  return true;
}

// Whether contacts and stops were sought as far as the pose found is from that of detection. Else the next
// iteration seeks them there.
bool World::Detail::CoversMotion() {
  const bool covers = detection_.CoversMotion(bodies_);
  const bool stops = stage_.all_stops || !PassesStop(bodies_.mechanisms, stops_);
  stage_.all_stops = stage_.all_stops || !stops;
  return covers && stops;
}

}  // namespace fork1s
