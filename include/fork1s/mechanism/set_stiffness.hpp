// One joint held more or less stiffly.
#pragma once

#include <fork1s/mechanism/definition.hpp>

namespace fork1s {

/// What holds one joint freedom, its spring and the servos that pull it alone, comes to `stiffness` together;
/// the shares of spring and servos stay, and so does the damping ratio. A freedom that nothing held gets a
/// spring. ScaleStiffness (mechanism.hpp) does it to all of a mechanism.
MechanismDef SetStiffness(MechanismDef definition, FreedomRef freedom, double stiffness);

}  // namespace fork1s
