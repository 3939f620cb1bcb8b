// What a viewer of `fork1s view` gets: frames a second, bytes a frame, and after how many frames a pull
// shows.
//
//     build/release/benchmarks/live_rate MODEL [OPTIONS OF view] ...     CSV; ten seconds, and twenty pulls
//
// Starts the program itself and is its only viewer, over the socket that a page would use.
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <cstring>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "../tests/server/socket_client.hpp"
#include "base/percentile.hpp"
#include "benchmarks.hpp"
#include "server/wire.hpp"

namespace fork1s::benchmarks::live_rate {
namespace {
using Json = nlohmann::json;
using Clock = std::chrono::steady_clock;

constexpr double kSeconds = 10;
constexpr int kPulls = 20;

// `fork1s view` as a child; ends with this object.
class Program {
 public:
  explicit Program(const std::vector<std::string>& arguments) {
    int ends[2];
    if (pipe(ends) != 0) return;
    child_ = fork();
    if (child_ == 0) {
      dup2(ends[1], STDOUT_FILENO);
      std::vector<char*> argv;
      for (const std::string& a : arguments) argv.push_back(const_cast<char*>(a.c_str()));
      argv.push_back(nullptr);
      execv(argv[0], argv.data());
      _exit(127);
    }
    close(ends[1]);
    std::string line;
    char c;
    while (read(ends[0], &c, 1) == 1 && c != '\n') line += c;
    const Json printed = Json::parse(line, nullptr, false);
    if (printed.is_object()) address_ = printed.value("address", "");
  }
  ~Program() {
    if (child_ <= 0) return;
    kill(child_, SIGTERM);
    waitpid(child_, nullptr, 0);
  }
  Program(const Program&) = delete;
  Program& operator=(const Program&) = delete;
  /// Of the page; empty where the program ended.
  const std::string& address() const { return address_; }

 private:
  pid_t child_ = -1;
  std::string address_;
};

template <class T>
T At(const std::string& bytes, std::size_t place) {
  T value;
  std::memcpy(&value, bytes.data() + place, sizeof value);
  return value;
}

// docs/wire.md: kind, epoch, sequence, flags, scalars, ... and pulls, each 40 bytes, before signals, of which
// there are none.
struct Frame {
  std::uint32_t sequence;
  double real_time_factor, step_us;
  std::size_t bytes;
  bool pulled;
};
Frame Read(const std::string& f) {
  constexpr std::size_t kPull = 40;
  const bool pulled = f.size() > kPull + 8 && At<std::uint32_t>(f, f.size() - kPull - 8) == 1;
  return {At<std::uint32_t>(f, 8), At<double>(f, 24), At<double>(f, 32), f.size(), pulled};
}

// The next frame; the body of the scene to pull at is noted on the way: the last that is no interface.
std::optional<Frame> Next(test::SocketClient& client, int& body) {
  while (auto message = client.ReadFrame()) {
    if (message->opcode == 1) {
      const Json text = Json::parse(message->payload);
      if (text["type"] != "scene") continue;
      int i = 0;
      for (const Json& b : text["bodies"]) {
        if (!b["interface"].get<bool>() && b["last_joint"].get<int>() >= 0) body = i;
        ++i;
      }
    } else if (At<std::uint32_t>(message->payload, 0) == static_cast<std::uint32_t>(WireKind::kFrame)) {
      return Read(message->payload);
    }
  }
  return {};
}

}  // namespace

int Main(int argc, char** argv) {
  if (argc < 2) {
    fmt::print(stderr, "usage: live_rate MODEL [OPTIONS OF view]\n");
    return 2;
  }
  std::vector<std::string> arguments{FORK1S_BINARY, "view", "--no-open", "--port", "0", "--json"};
  arguments.insert(arguments.end(), argv + 1, argv + argc);
  const Program program(arguments);
  if (program.address().empty()) return 3;  // it has said why
  test::SocketClient client(program.address());
  if (client.Upgrade().rfind("HTTP/1.1 101", 0) != 0) {
    fmt::print(stderr, "the program at {} took no viewer\n", program.address());
    return 1;
  }
  int body = 0;
  if (!Next(client, body)) return 1;
  std::vector<double> rates, step_us, bytes, between_ms;
  const auto start = Clock::now();
  auto before = start;
  double seconds = 0;
  while (seconds < kSeconds) {
    const auto frame = Next(client, body);
    if (!frame) return 1;
    const auto now = Clock::now();
    between_ms.push_back(1e3 * std::chrono::duration<double>(now - before).count());
    before = now;
    seconds = std::chrono::duration<double>(now - start).count();
    rates.push_back(frame->real_time_factor);
    step_us.push_back(frame->step_us);
    bytes.push_back(static_cast<double>(frame->bytes));
  }
  std::vector<double> answers;  // frames until a pull shows
  for (int i = 0; i < kPulls; ++i) {
    auto frame = Next(client, body);
    if (!frame) return 1;
    const std::uint32_t asked = frame->sequence;
    client.SendFrame(
        1, Json{{"type", "pull"}, {"body", body}, {"point", {0, 0, 0}}, {"target", {0, 0, 1}}}.dump());
    while (frame && !frame->pulled) frame = Next(client, body);
    if (!frame) return 1;
    answers.push_back(frame->sequence - asked);
    client.SendFrame(1, R"({"type":"release"})");
    while (frame && frame->pulled) frame = Next(client, body);
  }
  fmt::print(
      "model,frames_per_s,ms_between_frames_p99,real_time_factor,step_us,bytes_a_frame,frames_until_a_pull_"
      "shows,"
      "at_most\n");
  fmt::print("{},{:.2f},{:.1f},{:.3f},{:.1f},{:.0f},{:.0f},{:.0f}\n", argv[1],
             static_cast<double>(between_ms.size()) / seconds, Percentile(between_ms, 0.99), Median(rates),
             Median(step_us), Median(bytes), Median(answers), Percentile(answers, 1));
  return 0;
}

}  // namespace fork1s::benchmarks::live_rate
