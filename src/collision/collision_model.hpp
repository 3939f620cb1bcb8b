// A compiled MuJoCo model that serves as collision detector, and what can go wrong while compiling it.
#pragma once

#include <mujoco/mujoco.h>

#include <memory>
#include <vector>

#include "model_text.hpp"

namespace fork1s::internal {

struct ModelDeleter {
  void operator()(mjModel* model) const { mj_deleteModel(model); }
};
struct DataDeleter {
  void operator()(mjData* data) const { mj_deleteData(data); }
};
using ModelPointer = std::unique_ptr<mjModel, ModelDeleter>;
using DataPointer = std::unique_ptr<mjData, DataDeleter>;

/// Makes MuJoCo's fatal errors exceptions, unless another part of the program already handles them.
void CatchMujocoErrors();

/// Compiles the text. Errors: kModel, naming the geometry that MuJoCo refuses.
Expected<ModelPointer> CompileModel(const ModelText& text, const std::vector<CollisionBodyDef>& bodies);

/// As CompileModel, with SetPairOptions. Worlds of the same shapes at the same time share one model: `text`
/// is the same to the letter and names the same meshes and grids in memory.
Expected<std::shared_ptr<const mjModel>> CompileShared(const ModelText& text,
                                                       const std::vector<CollisionBodyDef>& bodies,
                                                       bool multi_point);

}  // namespace fork1s::internal
