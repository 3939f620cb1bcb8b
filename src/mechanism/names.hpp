// Words for the enumerations of definitions, as files, options, messages and recordings have them.
#pragma once

#include <fork1s/mechanism/definition.hpp>
#include <fork1s/mechanism/sensor.hpp>
#include <optional>
#include <string_view>
#include <utility>

namespace fork1s {

inline constexpr std::pair<BaseKind, const char*> kBaseKindNames[] = {
    {BaseKind::kFixed, "fixed"}, {BaseKind::kFloating, "floating"}, {BaseKind::kDriven, "driven"}};
inline constexpr std::pair<ModeChoice, const char*> kModeChoiceNames[] = {
    {ModeChoice::kLowest, "lowest"}, {ModeChoice::kContribution, "contribution"}};
inline constexpr std::pair<ParentFilter, const char*> kParentFilterNames[] = {
    {ParentFilter::kAll, "all"}, {ParentFilter::kMoving, "moving"}, {ParentFilter::kNone, "none"}};
inline constexpr std::pair<JointKind, const char*> kJointKindNames[] = {
    {JointKind::kHinge, "hinge"},    {JointKind::kSlide, "slide"},
    {JointKind::kBall, "ball"},      {JointKind::kCylindrical, "cylindrical"},
    {JointKind::kPlanar, "planar"},  {JointKind::kFree, "free"},
    {JointKind::kGeneral, "general"}};
inline constexpr std::pair<PathElementDef::Kind, const char*> kPathElementNames[] = {
    {PathElementDef::Kind::kPoint, "point"},
    {PathElementDef::Kind::kSphere, "sphere"},
    {PathElementDef::Kind::kCylinder, "cylinder"},
    {PathElementDef::Kind::kPulley, "pulley"}};
inline constexpr std::pair<PathKind, const char*> kPathKindNames[] = {
    {PathKind::kTendon, "thread"},
    {PathKind::kSliderCrank, "slider-crank"},
    {PathKind::kWrench, "wrench"},
    {PathKind::kAngle, "angle"}};
inline constexpr std::pair<ControlDynamics, const char*> kControlDynamicsNames[] = {
    {ControlDynamics::kNone, "none"},
    {ControlDynamics::kLag, "lag"},
    {ControlDynamics::kIntegrator, "integrator"},
    {ControlDynamics::kMuscle, "muscle"}};

inline constexpr std::pair<SensorKind, const char*> kSensorKindNames[] = {
    {SensorKind::kUnknown, "unknown"},
    {SensorKind::kTime, "time"},
    {SensorKind::kKineticEnergy, "kinetic-energy"},
    {SensorKind::kPotentialEnergy, "potential-energy"},
    {SensorKind::kLength, "length"},
    {SensorKind::kLengthRate, "length-rate"},
    {SensorKind::kLimitDistance, "limit-distance"},
    {SensorKind::kLimitRate, "limit-rate"},
    {SensorKind::kLimitForce, "limit-force"},
    {SensorKind::kBallRotation, "ball-rotation"},
    {SensorKind::kBallAngularVelocity, "ball-angular-velocity"},
    {SensorKind::kPosition, "position"},
    {SensorKind::kRotation, "rotation"},
    {SensorKind::kXAxis, "x-axis"},
    {SensorKind::kYAxis, "y-axis"},
    {SensorKind::kZAxis, "z-axis"},
    {SensorKind::kVelocity, "velocity"},
    {SensorKind::kAngularVelocity, "angular-velocity"},
    {SensorKind::kAcceleration, "acceleration"},
    {SensorKind::kAngularAcceleration, "angular-acceleration"},
    {SensorKind::kMagneticField, "magnetic-field"},
    {SensorKind::kSubtreeCenter, "subtree-center"},
    {SensorKind::kSubtreeVelocity, "subtree-velocity"},
    {SensorKind::kSubtreeAngularMomentum, "subtree-angular-momentum"},
    {SensorKind::kForce, "force"},
    {SensorKind::kTorque, "torque"},
    {SensorKind::kTouch, "touch"},
    {SensorKind::kActuatorForce, "actuator-force"},
    {SensorKind::kJointActuatorForce, "joint-actuator-force"},
    {SensorKind::kTendonActuatorForce, "tendon-actuator-force"},
    {SensorKind::kDistance, "distance"},
    {SensorKind::kInside, "inside"}};

/// The word of a value in one of these lists; "" for what is none.
template <class T, std::size_t count>
constexpr const char* NameIn(const std::pair<T, const char*> (&names)[count], T value) {
  for (const auto& [known, name] : names)
    if (known == value) return name;
  return "";
}
/// And back.
template <class T, std::size_t count>
constexpr std::optional<T> Named(const std::pair<T, const char*> (&names)[count], std::string_view word) {
  for (const auto& [value, name] : names)
    if (word == name) return value;
  return std::nullopt;
}

constexpr const char* Name(BaseKind kind) { return NameIn(kBaseKindNames, kind); }
constexpr const char* Name(ModeChoice choice) { return NameIn(kModeChoiceNames, choice); }
constexpr const char* Name(JointKind kind) { return NameIn(kJointKindNames, kind); }

}  // namespace fork1s
