// Viewers that stay: one that reads all it gets, one that drags and lets go, one that hardly reads. However
// long it lasts, memory stays, nobody is forgotten, and no step fails. A few seconds here; tools/soak.sh
// makes days of it by FORK1S_SOAK_HOURS, simulated hours, and gets a row an hour.
#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <thread>
#include <vector>

#include "server/live_server.hpp"
#include "socket_client.hpp"
#include "support.hpp"

namespace fork1s::test {
namespace {

double ResidentMb() {
  long pages = 0;
  if (std::FILE* file = std::fopen("/proc/self/statm", "r")) {
    if (std::fscanf(file, "%*d %ld", &pages) != 1) pages = 0;
    std::fclose(file);
  }
  return static_cast<double>(pages) * static_cast<double>(sysconf(_SC_PAGESIZE)) / 1e6;
}

// Reads until it has seen the frame numbered `last`, or is told to stop by a server that is gone.
class StayingViewer {
 public:
  StayingViewer(const std::string& page, int wait_us, int receive_buffer = 0)
      : client_(page, receive_buffer), wait_us_(wait_us) {
    client_.Upgrade();
    thread_ = std::thread([this] { Read(); });
  }
  ~StayingViewer() {
    if (thread_.joinable()) thread_.join();
  }
  void Send(const std::string& text) { client_.SendFrame(1, text); }
  void EndAt(std::uint32_t frame) { last_ = frame; }
  void Join() { thread_.join(); }
  std::uint32_t newest() const { return newest_; }
  long frames() const { return frames_; }

 private:
  void Read() {
    while (newest_ < last_) {
      const auto frame = client_.ReadFrame();
      if (!frame) return;
      if (frame->opcode == 9)
        client_.SendFrame(10, frame->payload);  // as every browser answers the server's pings
      std::uint32_t head[3];
      if (frame->opcode != 2 || frame->payload.size() < sizeof head) continue;
      std::memcpy(head, frame->payload.data(), sizeof head);
      if (head[0] != 2) continue;
      newest_ = head[2];
      ++frames_;
      if (wait_us_ > 0 && last_ == kNever) std::this_thread::sleep_for(std::chrono::microseconds(wait_us_));
    }
  }
  static constexpr std::uint32_t kNever = 0xffffffff;
  SocketClient client_;
  int wait_us_;
  std::atomic<std::uint32_t> newest_{0}, last_{kNever};
  std::atomic<long> frames_{0};
  std::thread thread_;
};

TEST(ServerSoak, ViewersThatStay) {
  const char* wanted = std::getenv("FORK1S_SOAK_HOURS");
  const double hours =
      wanted ? std::atof(wanted) : 0.04;  // the first half longer than the minute that is kept to go back to
  const auto frames = static_cast<std::uint32_t>(hours * 3600 * 60);
  const std::uint32_t an_hour = wanted ? 3600 * 60 : frames / 2;
  LiveSimulation live = Live("hand.xml", Recovery::kExact, "open");
  ServerOptions options;
  options.port = 0;
  options.page = "<html>page</html>";
  auto server = LiveServer::Create(options);
  ASSERT_TRUE(server);
  StayingViewer reads(server->address(), 0), drags(server->address(), 20000),
      slow(server->address(), 50000, 4096);
  for (int i = 0; i < 5000 && server->num_viewers() < 3; ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  ASSERT_EQ(server->num_viewers(), 3);
  double first_hour = 0;
  auto begun = std::chrono::steady_clock::now();
  if (wanted) std::puts("hour,us_a_frame,memory_mb,energy_j,frames_read,frames_of_the_slow");
  for (std::uint32_t i = 1; i <= frames; ++i) {
    if (i % 600 == 1)
      drags.Send(R"({"type":"pull","body":3,"point":[0,0,0],"target":[0,0,)" +
                 std::to_string(i % 1200 == 1 ? 0.1 : 0.2) + "]}");
    if (i % 600 == 300) drags.Send(R"({"type":"release"})");
    while (const auto command = server->PopCommand()) live.Handle(*command);
    live.Advance(kNoLimit);
    ASSERT_TRUE(live.PopFaults().empty()) << i;
    server->Publish(live.Capture(server->num_viewers()));
    if (i % an_hour != 0) continue;
    const double memory = ResidentMb();
    if (first_hour == 0) first_hour = memory;
    ASSERT_EQ(server->num_viewers(), 3) << i;
    const auto now = std::chrono::steady_clock::now();
    if (wanted)
      std::printf("%u,%.1f,%.2f,%.6f,%ld,%ld\n", i / an_hour,
                  std::chrono::duration<double, std::micro>(now - begun).count() / an_hour, memory,
                  live.simulation().Energy(), reads.frames(), slow.frames());
    std::fflush(stdout);
    begun = now;
  }
  EXPECT_EQ(live.simulation().steps(), frames);
  EXPECT_EQ(server->num_viewers(), 3);
  EXPECT_TRUE(std::isfinite(live.simulation().Energy()));
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
  EXPECT_LT(ResidentMb(), first_hour + 1);
#endif
  // All of them get the newest in the end, the slow one too.
  const std::uint32_t newest = frames;
  for (StayingViewer* viewer : {&reads, &drags, &slow}) viewer->EndAt(newest);
  server->Publish(live.Capture(3));
  for (StayingViewer* viewer : {&reads, &drags, &slow}) {
    viewer->Join();
    EXPECT_GE(viewer->newest(), newest);
  }
  EXPECT_LT(slow.frames(), reads.frames());
}

}  // namespace
}  // namespace fork1s::test
