// What programs that simulate need: models from files or code, reduction, simulation, recording. Comparisons
// (study/compare.hpp), error estimates and run summaries have headers of their own: docs/api_cpp.md.
#pragma once

#include <fork1s/geometry/inertia.hpp>
#include <fork1s/importer/importer.hpp>
#include <fork1s/mechanism/builder.hpp>
#include <fork1s/mechanism/set_stiffness.hpp>
#include <fork1s/record/csv.hpp>
#include <fork1s/record/gltf.hpp>
#include <fork1s/record/recording.hpp>
#include <fork1s/record/recovery_buffers.hpp>
#include <fork1s/record/reduced_model_file.hpp>
#include <fork1s/recovery/pose_arrays.hpp>
#include <fork1s/recovery/recover.hpp>
#include <fork1s/recovery/second_order.hpp>
#include <fork1s/reduction/compliance.hpp>
#include <fork1s/reduction/free_motion.hpp>
#include <fork1s/reduction/frequencies.hpp>
#include <fork1s/reduction/statics.hpp>
#include <fork1s/sim/continue.hpp>
#include <fork1s/sim/control_move.hpp>
#include <fork1s/sim/linearize.hpp>
#include <fork1s/sim/load_factor.hpp>
#include <fork1s/sim/queries.hpp>
#include <fork1s/sim/randomisation.hpp>
#include <fork1s/sim/sensors.hpp>
#include <fork1s/sim/simulation.hpp>
#include <fork1s/spatial/twist.hpp>
#include <fork1s/stepping/mechanism_dynamics.hpp>
