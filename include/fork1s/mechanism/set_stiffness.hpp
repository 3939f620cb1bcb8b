// One joint held more or less stiffly.
#pragma once

#include <fork1s/mechanism/definition.hpp>
#include <string>

namespace fork1s {

/// What holds one joint freedom, its spring and the servos that pull it alone, comes to `stiffness` together;
/// the shares of spring and servos stay, and so does the damping ratio. A freedom that nothing held gets a
/// spring. ScaleStiffness (mechanism.hpp) does it to all of a mechanism.
MechanismDef SetStiffness(MechanismDef definition, FreedomRef freedom, double stiffness);

/// The springs of that name, of tendons or of servos along them, come to `stiffness`, above 0, together, with the gain of the servo
/// and the bounds of its force; their damping ratio stays. At least one of that name has a stiffness above 0.
MechanismDef SetStiffness(MechanismDef definition, const std::string& spring, double stiffness);
/// Stiffness of the springs of that name together [N/m or N·m/rad of their length]; 0 where there is none.
double StiffnessOf(const MechanismDef& definition, const std::string& spring);

}  // namespace fork1s
