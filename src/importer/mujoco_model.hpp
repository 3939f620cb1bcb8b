// A file compiled by MuJoCo, with its complaints turned into our errors.
#pragma once

#include <mujoco/mujoco.h>
#include <fork1s/base/error.hpp>
#include <map>
#include <memory>
#include <string>
#include <vector>

namespace fork1s::internal {

struct MjModelDeleter {
  void operator()(mjModel* m) const { mj_deleteModel(m); }
};
struct MjDataDeleter {
  void operator()(mjData* d) const { mj_deleteData(d); }
};

struct CompiledModel {
  std::unique_ptr<mjModel, MjModelDeleter> model;
  std::unique_ptr<mjData, MjDataDeleter> data;  // kinematics at qpos0
  std::vector<std::string> warnings;
};

/// What MuJoCo is to compile: a file on disk, or text with the files it refers to.
struct ModelSource {
  std::string path;  // stands in messages; read from disk if `text` is empty
  std::string text;
  std::map<std::string, std::string> files;    // name used in the text -> path on disk
  std::map<std::string, std::string> buffers;  // name used in the text, or path of a model file -> content
};

/// Kinematics, lengths and transmissions at qpos0. Errors: kModel, with `name` for the file.
Expected<std::unique_ptr<mjData, MjDataDeleter>> ReferenceData(const mjModel& model, const std::string& name);

/// Whether MuJoCo has a plugin of that name, those beside its library included.
bool IsKnownPlugin(const std::string& name);

/// A model between its file and its compilation, in which elements can be changed, added and removed.
class EditableModel {
 public:
  /// Errors: kFile, kFormat with line, kModel.
  static Expected<EditableModel> Parse(ModelSource source);

  mjSpec* spec() { return spec_.get(); }
  /// Compiles the elements as they now are and computes the kinematics at qpos0; may be called again after
  /// changes. Errors: kModel.
  Expected<CompiledModel> Compile();
  /// MJCF of the elements as they were compiled last, numbers with 15 digits. Errors: kModel.
  Expected<std::string> Text() const;

 private:
  struct VfsDeleter {
    void operator()(mjVFS* vfs) const;
  };
  struct SpecDeleter {
    void operator()(mjSpec* spec) const { mj_deleteSpec(spec); }
  };
  EditableModel() = default;
  ModelSource source_;
  std::vector<std::string> warnings_;  // of the parser
  std::unique_ptr<mjVFS, VfsDeleter> vfs_;
  std::unique_ptr<mjSpec, SpecDeleter> spec_;
};

/// Compiles and computes the kinematics at qpos0. Errors: kFile, kFormat with line, kModel.
Expected<CompiledModel> CompileModel(const ModelSource& source);

}  // namespace fork1s::internal
