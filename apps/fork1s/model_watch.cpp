#include "model_watch.hpp"

#include <chrono>

namespace fork1s::app {

std::optional<FileStamp> StampOf(const std::string& path) {
  std::error_code error;
  FileStamp stamp;
  stamp.written = std::filesystem::last_write_time(path, error);
  if (error) return {};
  stamp.size = std::filesystem::file_size(path, error);
  if (error) return {};
  return stamp;
}

ModelWatch::ModelWatch(std::string path, std::optional<FileStamp> seen, Load load)
    : path_(std::move(path)), load_(std::move(load)), seen_(seen), thread_([this] { Look(); }) {}

ModelWatch::~ModelWatch() {
  stop_ = true;
  thread_.join();
}

void ModelWatch::Look() {
  constexpr int kLooks = 10;  // short sleeps between two looks, so that ending never waits long
  std::optional<FileStamp> before = seen_;
  while (true) {
    for (int i = 0; i < kLooks; ++i) {
      if (stop_) return;
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
    }
    const std::optional<FileStamp> now = StampOf(path_);
    // A change counts when two looks saw the same: files are often written in pieces.
    const bool settled = now == before;
    before = now;
    if (!now || !settled || now == seen_) continue;
    seen_ = now;
    auto loaded = load_();
    const std::lock_guard<std::mutex> lock(mutex_);
    loaded_.emplace(std::move(loaded));
  }
}

std::optional<Expected<LiveSimulation>> ModelWatch::Take() {
  const std::lock_guard<std::mutex> lock(mutex_);
  std::optional<Expected<LiveSimulation>> taken = std::move(loaded_);
  loaded_.reset();
  return taken;
}

}  // namespace fork1s::app
