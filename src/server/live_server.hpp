// Serves the page on 127.0.0.1 and streams snapshots to every viewer, on a thread of its own.
//
// The newest snapshot wins: a viewer gets its next message when it has taken the one before, whatever was
// published in between, so a slow or dead one costs the simulation nothing.
#pragma once

#include <fork1s/base/error.hpp>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "server/command.hpp"
#include "server/snapshot.hpp"

namespace fork1s {

struct ServerOptions {
  unsigned short port = 8080;  // 0: any that is free
  std::string_view page;       // HTML; must outlive the server
  /// Requests need the random token of `address`, so that other users of the machine are refused.
  bool require_token = true;
  std::size_t max_viewers = 32;
  std::size_t max_message = 64 << 10;  // bytes a viewer may send at once
  std::size_t max_queue = 1024;        // commands waiting for the simulation
  /// Takes files that a page PUTs (frames of a video); empty: none are taken. Called on the server's thread.
  std::function<bool(const std::string& path, const std::string& body)> take_file;
};

class LiveServer {
 public:
  /// Starts listening. Errors (kModel): the port is taken or not allowed, or no token can be made.
  static Expected<LiveServer> Create(const ServerOptions& options);
  ~LiveServer();
  LiveServer(LiveServer&&) noexcept;
  LiveServer& operator=(LiveServer&&) noexcept;

  unsigned short port() const;
  /// Of the page, with the token: http://127.0.0.1:PORT/?token=TOKEN
  std::string address() const;
  /// Replaces what viewers get next. Never waits for any of them.
  void Publish(Snapshot snapshot);
  /// The command that has waited longest. One that undoes another that still waits (a setting, a pull) takes
  /// its place.
  std::optional<Command> PopCommand();
  /// All that wait, in the order in which they came.
  std::vector<Command> PopCommands();
  /// One viewer, or with viewer 0 all, a message of docs/wire.md.
  void Send(int viewer, const std::string& message);
  /// Tells one viewer (or with viewer 0 all) a sentence that passes.
  void Notify(int viewer, const std::string& sentence);
  /// Tells one viewer (or with viewer 0 all) what went wrong; it stays on the page. `about`: docs/wire.md.
  void SendProblem(int viewer, const std::string& about, const std::string& sentence);
  int num_viewers() const;

 private:
  LiveServer();
  struct Detail;
  std::unique_ptr<Detail> detail_;
};

}  // namespace fork1s
