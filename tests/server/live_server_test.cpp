// The server against viewers that behave and viewers that do not.
#include <sys/resource.h>
#include <sys/stat.h>

#include <chrono>
#include <fstream>
#include <thread>

#include "failed_accepts.hpp"
#include "server/launch_file.hpp"
#include "server/live_server.hpp"
#include "socket_client.hpp"
#include "support.hpp"

namespace fork1s::test {
namespace {

constexpr std::string_view kPage = "<html>page</html>";

// A server with a simulation behind it that this test steps itself.
class Served : public ::testing::Test {
 protected:
  Served() : live_(Live("hand.xml", Recovery::kExact, "open")) {
    ServerOptions options;
    options.port = 0;
    options.page = kPage;
    options.max_viewers = 4;
    auto server = LiveServer::Create(options);
    if (!server) throw std::runtime_error(server.error().Text());
    server_.emplace(std::move(*server));
  }

  void Frame() {
    for (const Command& c : server_->PopCommands())
      if (auto refusal = live_.Handle(c)) server_->Notify(c.viewer, refusal->sentence);
    live_.Advance(kNoLimit);
    server_->Publish(live_.Capture(server_->num_viewers()));
  }
  template <class Condition>
  bool Until(Condition condition) {
    for (int i = 0; i < 500; ++i) {
      if (condition()) return true;
      Frame();
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    return false;
  }

  LiveSimulation live_;
  std::optional<LiveServer> server_;
};

bool Starts(const std::string& text, const char* with) { return text.rfind(with, 0) == 0; }

TEST_F(Served, GivesThePageAndNothingElse) {
  SocketClient client(server_->address());
  EXPECT_TRUE(Starts(client.Ask("GET " + client.Target("/") + " HTTP/1.1\r\nHost: localhost\r\n\r\n"),
                     "HTTP/1.1 200"));
  SocketClient other(server_->address());
  EXPECT_TRUE(
      Starts(other.Ask("GET " + other.Target("/../etc/passwd") + " HTTP/1.1\r\nHost: localhost\r\n\r\n"),
             "HTTP/1.1 404"));
  SocketClient put(server_->address());
  EXPECT_TRUE(Starts(
      put.Ask("PUT " + put.Target("/x") + " HTTP/1.1\r\nHost: localhost\r\nContent-Length: 1\r\n\r\nx"),
      "HTTP/1.1 405"));
}

TEST_F(Served, StreamsGeometrySceneMapsThenFrames) {
  SocketClient client(server_->address());
  ASSERT_TRUE(Starts(client.Upgrade(), "HTTP/1.1 101"));
  Frame();
  std::vector<int> opcodes;
  std::vector<std::uint32_t> kinds;
  while (kinds.empty() || kinds.back() != 2) {
    Frame();
    const auto frame = client.ReadFrame();
    ASSERT_TRUE(frame);
    opcodes.push_back(frame->opcode);
    if (frame->opcode != 2) continue;
    std::uint32_t kind;
    std::memcpy(&kind, frame->payload.data(), 4);
    kinds.push_back(kind);
  }
  EXPECT_EQ(opcodes, (std::vector<int>{1, 2, 1, 1, 1, 2,
                                       2}));  // geometry, meshes, scene, settings, tuning, maps, frame
  EXPECT_EQ(kinds, (std::vector<std::uint32_t>{3, 1, 2}));
}

TEST_F(Served, RefusesForeignPagesAndNames) {
  for (const char* origin : {"http://example.org", "https://127.0.0.1.example.org", "null",
                             "http://127.0.0.1.evil.com", "file://", "http://localhost@evil.com"}) {
    SocketClient client(server_->address());
    EXPECT_TRUE(Starts(client.Upgrade("Origin: " + std::string(origin) + "\r\n"), "HTTP/1.1 403")) << origin;
  }
  SocketClient rebound(server_->address());
  EXPECT_TRUE(Starts(rebound.Upgrade("", "evil.com"), "HTTP/1.1 403"));
  // Another program of this machine that serves pages, and its own page.
  SocketClient neighbour(server_->address());
  EXPECT_TRUE(
      Starts(neighbour.Upgrade("Origin: http://127.0.0.1:3000\r\n", "127.0.0.1:8080"), "HTTP/1.1 403"));
  SocketClient own(server_->address());
  EXPECT_TRUE(Starts(own.Upgrade("Origin: http://127.0.0.1:8080\r\n", "127.0.0.1:8080"), "HTTP/1.1 101"));
}

// On a machine with several users whoever reaches the port is not its owner.
TEST_F(Served, RequestsWithoutTheTokenAreForbidden) {
  const std::string address = server_->address();
  const std::string token = address.substr(address.find("?token=") + 7);
  EXPECT_EQ(token.find_first_not_of("0123456789abcdef"), std::string::npos) << token;
  ASSERT_EQ(token.size(), 32u);
  std::string wrong = token;
  wrong.back() = wrong.back() == '0' ? '1' : '0';
  for (const std::string& query :
       {std::string(), std::string("?token="), "?token=" + wrong, "?token=" + token + "0",
        "?token=" + token.substr(1), "?other=" + token, "#token=" + token}) {
    const std::string bare = address.substr(0, address.find('?')) + query;
    SocketClient stream(bare), page(bare), put(bare);
    EXPECT_TRUE(Starts(stream.Upgrade(), "HTTP/1.1 403")) << query;
    EXPECT_TRUE(Starts(
        put.Ask("PUT " + put.Target("/done") + " HTTP/1.1\r\nHost: localhost\r\nContent-Length: 0\r\n\r\n"),
        "HTTP/1.1 403"))
        << query;
    const std::string answer =
        page.Ask("GET " + page.Target("/") + " HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n");
    EXPECT_TRUE(Starts(answer, "HTTP/1.1 403")) << query;
    EXPECT_NE(page.ReadBody().find("address that the program printed"), std::string::npos) << query;
  }
  EXPECT_EQ(server_->num_viewers(), 0);
  SocketClient among_others(address.substr(0, address.find('?')) + "?a=1&token=" + token);
  EXPECT_TRUE(Starts(among_others.Upgrade(), "HTTP/1.1 101"));
}

TEST(LiveServer, TokensAreRandomAndCanBeLeftOut) {
  ServerOptions options;
  options.port = 0;
  options.page = kPage;
  const auto one = LiveServer::Create(options), other = LiveServer::Create(options);
  ASSERT_TRUE(one && other);
  EXPECT_NE(one->address().substr(one->address().find('?')),
            other->address().substr(other->address().find('?')));
  options.require_token = false;
  const auto open = LiveServer::Create(options);
  ASSERT_TRUE(open);
  EXPECT_EQ(open->address(), "http://127.0.0.1:" + std::to_string(open->port()) + "/");
  SocketClient client(open->address());
  EXPECT_TRUE(Starts(client.Upgrade(), "HTTP/1.1 101"));
}

// A command line can be read by every user of the machine.
TEST(LaunchFile, IsPrivateGoesOnToTheAddressAndIsRemoved) {
  std::string path;
  {
    const auto file = LaunchFile::Create(::testing::TempDir(), "http://127.0.0.1:1/?token=a#film=1&at=2");
    ASSERT_TRUE(file) << file.error().Text();
    path = file->address().substr(std::string("file://").size());
    struct stat facts {};
    ASSERT_EQ(stat(path.c_str(), &facts), 0);
    EXPECT_EQ(facts.st_mode & 0777, 0600u);
    std::ifstream in(path);
    const std::string text((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
    EXPECT_NE(text.find("url=http://127.0.0.1:1/?token=a#film=1&amp;at=2\""), std::string::npos) << text;
  }
  EXPECT_NE(access(path.c_str(), F_OK), 0);
  EXPECT_FALSE(LaunchFile::Create("/nowhere", "http://127.0.0.1:1/"));
}

TEST_F(Served, ClosesOnMalformedMessagesWithAReasonAndGoesOn) {
  const auto close_after = [&](int opcode, const std::string& payload) {
    SocketClient client(server_->address());
    client.Upgrade();
    client.SendFrame(opcode, payload);
    return client.ReadClose();
  };
  for (const char* text : {"", "{", "[]", R"({"type":"fly"})",
                           R"({"type":"pull","body":1,"point":[0,0,1e999],"target":[0,0,0]})",
                           R"({"type":"pull","body":1,"point":[0,0,NaN],"target":[0,0,0]})"}) {
    const auto closed = close_after(1, text);
    ASSERT_TRUE(closed) << text;
    EXPECT_EQ(closed->code, 1008) << text;
    EXPECT_GT(closed->reason.size(), 10u) << text;
  }
  EXPECT_EQ(close_after(2, "binary").value_or(SocketClient::Close{}).code, 1003);
  EXPECT_EQ(close_after(1, "\xff\xfe\xfd").value_or(SocketClient::Close{}).code, 1007);
  const auto huge = close_after(1, std::string(1 << 20, ' '));
  EXPECT_TRUE(!huge || huge->code == 1009);  // or reset, while the rest was still on its way
  const auto steps = live_.simulation().steps();
  Frame();
  EXPECT_GT(live_.simulation().steps(), steps);
  SocketClient next(server_->address());
  EXPECT_TRUE(Starts(next.Upgrade(), "HTTP/1.1 101"));
}

TEST_F(Served, GarbageBytesHarmNobody) {
  for (const std::string& bytes :
       {std::string("\x00\x01\x02", 3), std::string(100000, 'A'), std::string("GET / HTTP/9.9\r\n\r\n"),
        "GET / HTTP/1.1\r\nHost: localhost\r\nContent-Length: 99999999999\r\n\r\n" + std::string(10, 'x')}) {
    SocketClient client(server_->address());
    client.Send(bytes);
  }
  SocketClient client(server_->address());
  EXPECT_TRUE(Starts(client.Upgrade(), "HTTP/1.1 101"));
}

TEST_F(Served, UnusableRequestsGetTheirStatus) {
  const auto status = [&](const std::string& request) {
    SocketClient client(server_->address());
    return client.Ask(request).substr(0, 12);
  };
  EXPECT_EQ(status("GARBAGE\r\n\r\n"), "HTTP/1.1 400");
  EXPECT_EQ(status("GET / HTTP/9.9\r\n\r\n"), "HTTP/1.1 400");
  EXPECT_EQ(status("POST / HTTP/1.1\r\nHost: localhost\r\nContent-Length: 99999999999\r\n\r\nx"),
            "HTTP/1.1 413");
  EXPECT_EQ(status("GET / HTTP/1.1\r\nHost: localhost\r\nX: " + std::string(100000, 'A') + "\r\n\r\n"),
            "HTTP/1.1 431");
}

// Without descriptors no connection can be taken; the server tries ten times a second, not as often as it can, and goes
// on in better times.
TEST_F(Served, WaitsWhereNoDescriptorIsFree) {
  rlimit before{};
  getrlimit(RLIMIT_NOFILE, &before);
  const int lowest_free = dup(0);
  close(lowest_free);
  const rlimit one_more{static_cast<rlim_t>(lowest_free + 1), before.rlim_max};
  setrlimit(RLIMIT_NOFILE, &one_more);
  const long failed_before = failed_accepts;
  const auto begun = std::chrono::steady_clock::now();
  SocketClient waiting(server_->address());  // takes the last descriptor there is
  for (int i = 0; i < 3000 && failed_accepts < failed_before + 3; ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  const long failed = failed_accepts - failed_before;
  const std::chrono::duration<double> passed = std::chrono::steady_clock::now() - begun;
  setrlimit(RLIMIT_NOFILE, &before);
  EXPECT_GE(failed, 3);
  EXPECT_LE(static_cast<double>(failed), 1 + passed.count() / 0.1);
  EXPECT_TRUE(Starts(waiting.Upgrade(), "HTTP/1.1 101"));
}

TEST_F(Served, OfASettingOnlyTheLastValueWaits) {
  SocketClient one(server_->address()), two(server_->address());
  one.Upgrade();
  two.Upgrade();
  const auto set = [](const char* setting, int value) {
    return R"({"type":"set","setting":")" + std::string(setting) + R"(","value":)" + std::to_string(value) +
           "}";
  };
  for (int i = 0; i < 600; ++i) {
    one.SendFrame(1, set("friction", i));
    one.SendFrame(1, set("damping", i));
    two.SendFrame(1, set("friction", i));
  }
  one.SendFrame(1, R"({"type":"step"})");
  two.SendFrame(1, R"({"type":"step"})");
  std::vector<Command> waiting;
  int steps = 0;
  for (int i = 0; i < 500 && steps < 2; ++i) {
    for (Command& c : server_->PopCommands()) {
      steps += c.kind == Command::Kind::kStep ? 1 : 0;
      waiting.push_back(std::move(c));
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  ASSERT_EQ(steps, 2);
  const auto last = [&](const char* setting) {
    double value = -1;
    for (const Command& c : waiting)
      if (c.setting == setting) value = c.value;
    return value;
  };
  EXPECT_EQ(last("friction"), 599);
  EXPECT_EQ(last("damping"), 599);
}

TEST_F(Served, ASlowViewerCostsTheSimulationNothingAndGetsTheNewest) {
  SocketClient slow(server_->address(), 4096);
  slow.Upgrade();
  const auto start = std::chrono::steady_clock::now();
  for (int i = 0; i < 3000; ++i) Frame();  // many times what the socket's buffers hold
  EXPECT_LT(std::chrono::steady_clock::now() - start,
            std::chrono::seconds(60));  // it never waited for a time-out
  std::uint32_t newest = 0, frames = 0;
  for (int i = 0; i < 3000 && newest < 3000; ++i) {
    const auto frame = slow.ReadFrame();
    ASSERT_TRUE(frame);
    std::uint32_t head[3];
    if (frame->opcode != 2 || frame->payload.size() < sizeof head) continue;
    std::memcpy(head, frame->payload.data(), sizeof head);
    if (head[0] != 2) continue;
    ++frames;
    newest = head[2];
  }
  EXPECT_EQ(newest, 3000u);
  EXPECT_LT(frames, 3000u);
}

TEST_F(Served, TheOneWhoDragsAndDiesLetsGo) {
  auto drags = std::make_unique<SocketClient>(server_->address());
  drags->Upgrade();
  drags->SendFrame(1, R"({"type":"pull","body":3,"point":[0,0,0],"target":[0,0,1]})");
  ASSERT_TRUE(Until([&] { return live_.pulls().size() == 1; }));
  SocketClient other(server_->address());
  other.Upgrade();
  other.SendFrame(1, R"({"type":"pull","body":4,"point":[0,0,0],"target":[0,0,1]})");
  bool told = false;
  for (int i = 0; i < 200 && !told; ++i) {
    Frame();
    const auto frame = other.ReadFrame();
    told = frame && frame->payload.find("another viewer") != std::string::npos;
  }
  EXPECT_TRUE(told);
  EXPECT_EQ(live_.pulls()[0].body, 3);
  drags.reset();
  EXPECT_TRUE(Until([&] { return live_.pulls().empty(); }));
}

TEST_F(Served, ManyViewersButNotAnyNumber) {
  std::vector<std::unique_ptr<SocketClient>> clients;
  for (int i = 0; i < 4; ++i) {
    clients.push_back(std::make_unique<SocketClient>(server_->address()));
    EXPECT_TRUE(Starts(clients.back()->Upgrade(), "HTTP/1.1 101"));
  }
  SocketClient fifth(server_->address());
  EXPECT_TRUE(Starts(fifth.Upgrade(), "HTTP/1.1 503"));
  clients.pop_back();
  EXPECT_TRUE(Until([&] { return server_->num_viewers() == 3; }));
  SocketClient sixth(server_->address());
  EXPECT_TRUE(Starts(sixth.Upgrade(), "HTTP/1.1 101"));
}

TEST_F(Served, AFloodOfRequestsIsBounded) {
  SocketClient client(server_->address());
  client.Upgrade();
  std::string flood;
  for (int i = 0; i < 3000; ++i)
    client.SendFrame(1, i % 2 ? R"({"type":"step"})" : R"({"type":"pause","on":true})");
  // What answers a ping has read all before it, however slow it is.
  client.SendFrame(9, "all");
  bool answered = false;
  while (!answered) {
    const auto frame = client.ReadFrame();
    ASSERT_TRUE(frame);
    answered = frame->opcode == 10;
  }
  EXPECT_LE(server_->PopCommands().size(), 1024u);
}

TEST(LiveServer, APortThatIsTakenIsNamed) {
  ServerOptions options;
  options.port = 0;
  auto first = LiveServer::Create(options);
  ASSERT_TRUE(first);
  options.port = first->port();
  const auto second = LiveServer::Create(options);
  ASSERT_FALSE(second);
  EXPECT_NE(second.error().Text().find("choose another port"), std::string::npos);
}

}  // namespace
}  // namespace fork1s::test
