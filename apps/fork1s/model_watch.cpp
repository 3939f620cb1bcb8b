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
    : path_(std::move(path)), load_(std::move(load)), seen_(seen), thread_([this] { Watch(); }) {}

ModelWatch::~ModelWatch() {
  stop_ = true;
  thread_.join();
}

void ModelWatch::Watch() {
  constexpr int kLooks = 10;    // short sleeps between two looks, so that ending never waits long
  constexpr int kPatience = 4;  // looks without a file: editors take it away for a moment
  std::optional<FileStamp> before = seen_;
  int missing = 0;
  while (true) {
    for (int i = 0; i < kLooks; ++i) {
      if (stop_) return;
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
    }
    const std::optional<FileStamp> now = StampOf(path_);
    // A change counts when two looks saw the same: files are often written in pieces.
    const bool settled = now == before;
    before = now;
    missing = now ? 0 : missing + 1;
    if (missing == kPatience) {
      seen_.reset();  // when it comes back it is new, whatever its date
      Offer(Fail(ErrorCode::kFile, path_,
                 std::filesystem::is_directory(path_) ? "is a folder now; the model goes on as it was read"
                                                      : "is gone; the model goes on as it was read"));
    }
    if (!now || !settled || now == seen_) continue;
    seen_ = now;
    Offer(load_(stop_));
  }
}

void ModelWatch::Offer(Expected<LiveSimulation> loaded) {
  const std::lock_guard<std::mutex> lock(mutex_);
  loaded_.emplace(std::move(loaded));
}

std::optional<Expected<LiveSimulation>> ModelWatch::Pop() {
  const std::lock_guard<std::mutex> lock(mutex_);
  std::optional<Expected<LiveSimulation>> taken = std::move(loaded_);
  loaded_.reset();
  return taken;
}

}  // namespace fork1s::app
