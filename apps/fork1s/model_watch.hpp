// A model file that is edited while it is watched.
#pragma once

#include <atomic>
#include <filesystem>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "server/live_simulation.hpp"

namespace fork1s::app {

/// When a file was last written and how long it is; equal stamps: the same content, as far as we look.
struct FileStamp {
  std::filesystem::file_time_type written{};
  std::uintmax_t size = 0;
  bool operator==(const FileStamp&) const = default;
};
/// None while there is no such file: editors replace files by removing them first.
std::optional<FileStamp> StampOf(const std::string& path);

/// Looks at a file twice a second and loads it again once a change has settled, on a thread of its own:
/// reading a model with meshes takes longer than a frame. Files that it includes are not looked at.
class ModelWatch {
 public:
  using Load = std::function<Expected<LiveSimulation>(const std::atomic<bool>& stop)>;
  /// `seen`: of the file as it was read first. `load` is called on another thread, and may
  /// end early once `stop` is set.
  ModelWatch(std::string path, std::optional<FileStamp> seen, Load load);
  ~ModelWatch();
  ModelWatch(const ModelWatch&) = delete;
  ModelWatch& operator=(const ModelWatch&) = delete;

  /// What the newest change led to, once; an error also where the file went.
  std::optional<Expected<LiveSimulation>> Pop();

 private:
  void Watch();
  void Offer(Expected<LiveSimulation> loaded);

  const std::string path_;
  const Load load_;
  std::optional<FileStamp> seen_;
  std::mutex mutex_;
  std::optional<Expected<LiveSimulation>> loaded_;  // guarded
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

}  // namespace fork1s::app
