// The arguments that say which model is meant, shared by all commands that take one.
#pragma once

#include <atomic>
#include <fork1s/importer/importer.hpp>
#include <fork1s/world/world.hpp>
#include <optional>
#include <string>
#include <vector>

#include "command.hpp"
#include "study/mjcf_file.hpp"

namespace fork1s::app {

/// The group of the options that AddTo adds.
inline constexpr const char* kModelOptions = "Options of the model, the same in every command";

inline const std::atomic<bool> kNeverStopped{false};

struct ModelArguments {
  std::string path;
  std::vector<std::string> interfaces, switched;
  std::string base;
  std::string modes;  // a number or "auto"
  std::string mode_choice;
  double stiffness_scale = 1;
  std::vector<std::string> pd;
  std::string keyframe;
  std::string base_pose;                 // "x,y,z[,r,p,y]"
  std::vector<std::string> coordinates;  // "NAME=VALUE"
  bool keep_start = false;
  bool hold = false;
  std::string ground;                 // "under", or a height
  std::vector<std::string> packages;  // "NAME=DIR"
  double read_time = 60;              // limit of Load, s
  bool json = false;

  void AddTo(CLI::App& command);
  /// Reads the model in a child process (ReadInChild), until `stop` is set. Errors have options as they were typed.
  Expected<ImportedScene> Load(const std::atomic<bool>& stop = kNeverStopped) const;
  /// WriteMjcfFile of the model with these options.
  Expected<MjcfModel> WriteMjcf(const std::string& out) const;
  /// ShareWithMuJoCo of the model with these options.
  Expected<SharedModel> ShareWithMuJoCo(ImportedScene imported) const;
  Expected<ImportOptions> Options() const;
  /// Whether the keyframe is a start that the importer made of the options or of limits and loops, and so none
  /// of the file.
  bool IsMadeStart(const KeyframeDef& start) const { return start.name != keyframe; }
  /// "keyframe 'home', set-points by --hold". `start`: the initial keyframe, null for none.
  std::string StartText(const KeyframeDef* start) const;
  /// The words of a command line that AddTo reads as these arguments, the model last.
  std::vector<std::string> Words() const;

 private:
  Expected<void> ReadStart(ImportOptions& options) const;
};

/// LoadMechanism; what libraries print beside an error is dropped.
Expected<ImportedScene> ReadQuietly(const std::string& path, const ImportOptions& options);

/// --integrator, as given.
void AddIntegratorTo(CLI::App& command, std::optional<Integrator>& integrator);

/// --recovery.
void AddRecoveryTo(CLI::App& command, Recovery& recovery);

/// --push: texts for PushTrack::Parse.
void AddPushTo(CLI::App& command, std::vector<std::string>& pushes);

/// "x,y,z" to a vector.
Expected<Vector3> ParseVector(const std::string& text, const std::string& option);

}  // namespace fork1s::app
