// The only file that knows Boost.
#include <utility>  // Boost.Asio 1.74 uses std::exchange without including it

#include <atomic>
#include <boost/asio/bind_executor.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>
#include <deque>
#include <map>
#include <mutex>
#include <optional>
#include <thread>

#include <fmt/format.h>

#include "access_token.hpp"
#include "base/system_error.hpp"
#include "command_queue.hpp"
#include "outbox.hpp"
#include "request_origin.hpp"
#include "scene_description.hpp"
#include "server/live_server.hpp"

namespace fork1s {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
namespace websocket = beast::websocket;
using tcp = asio::ip::tcp;
using ErrorOf = beast::error_code;

constexpr std::size_t kMaxFile = 64u << 20;  // bytes of one PUT

// What a request that cannot be read deserves, none where the other side went or said nothing.
std::optional<http::status> StatusOf(const ErrorOf& error) {
  if (error == http::error::body_limit) return http::status::payload_too_large;
  if (error == http::error::header_limit) return http::status::request_header_fields_too_large;
  if (error == http::error::end_of_stream || error == http::error::partial_message) return {};
  if (error.category() == make_error_code(http::error::end_of_stream).category())
    return http::status::bad_request;
  return {};
}

std::string_view View(beast::string_view s) { return {s.data(), s.size()}; }

Message Notice(const std::string& text) {
  return std::make_shared<const std::string>(internal::Dump({{"type", "notice"}, {"message", text}}));
}

}  // namespace

struct LiveServer::Detail {
  class Connection;
  class Viewer;

  explicit Detail(const ServerOptions& o) : options(o), commands(o.max_queue) {
    context.emplace(1);
    acceptor.emplace(*context);
    pause.emplace(*context);
  }
  // Handlers that never ran hold viewers, and a viewer that goes tells the rest of this object.
  ~Detail() {
    pause.reset();
    acceptor.reset();
    context.reset();
  }

  void Accept();
  void Drop(int viewer);
  /// False where the queue is full: the command is not taken.
  bool Queue(Command command);
  /// One viewer, or with 0 all. From any thread.
  void Notify(int viewer, Message message);

  ServerOptions options;
  std::string token;  // empty: none is required
  std::optional<asio::io_context> context;
  std::optional<tcp::acceptor> acceptor;
  std::optional<asio::steady_timer> pause;       // before the next attempt to accept
  std::map<int, std::weak_ptr<Viewer>> viewers;  // server thread only
  std::atomic<int> num_viewers{0};
  int next_viewer = 1;

  std::mutex mutex;
  Snapshot latest;                  // guarded
  internal::CommandQueue commands;  // guarded
  std::atomic<bool> notified{false};
  std::thread thread;
};

// One WebSocket. All on the server thread.
class LiveServer::Detail::Viewer : public std::enable_shared_from_this<Viewer> {
 public:
  Viewer(Detail& server, beast::tcp_stream&& stream, int id)
      : server_(server), socket_(std::move(stream)), id_(id) {}
  ~Viewer() { server_.Drop(id_); }

  void Start(const http::request<http::string_body>& request) {
    beast::get_lowest_layer(socket_).expires_never();
    auto timeout = websocket::stream_base::timeout::suggested(beast::role_type::server);
    timeout.idle_timeout = std::chrono::seconds(20);
    timeout.keep_alive_pings = true;
    socket_.set_option(timeout);
    socket_.auto_fragment(false);
    socket_.read_message_max(server_.options.max_message);
    socket_.async_accept(request, [self = shared_from_this()](ErrorOf error) {
      if (error) return;
      self->open_ = true;
      self->Read();
      self->WriteNext();
    });
  }

  void Notify(Message message) {
    constexpr std::size_t kMaxSentences = 16;
    if (sentences_.size() < kMaxSentences) sentences_.push_back(std::move(message));
    WriteNext();
  }

  void WriteNext() {
    if (!open_ || writing_ || closing_) return;
    bool binary = false;
    writing_ = Choose(binary);
    if (!writing_) return;
    socket_.binary(binary);
    socket_.async_write(asio::buffer(*writing_), [self = shared_from_this()](ErrorOf error, std::size_t) {
      self->writing_.reset();
      if (error) {
        self->open_ = false;
        return;
      }
      if (self->closing_)
        self->Close();
      else
        self->WriteNext();
    });
  }

 private:
  Message Choose(bool& binary) {
    binary = false;
    if (!sentences_.empty()) {
      Message next = std::move(sentences_.front());
      sentences_.pop_front();
      return next;
    }
    const std::lock_guard<std::mutex> lock(server_.mutex);
    return outbox_.Next(server_.latest, binary);
  }

  void Read() {
    socket_.async_read(buffer_, [self = shared_from_this()](ErrorOf error, std::size_t) {
      if (error) {
        self->open_ = false;
        return;
      }
      self->Receive();
    });
  }

  void Receive() {
    if (!socket_.got_text())
      return Refuse(websocket::close_code::unknown_data, "only text messages are understood");
    const std::string text = beast::buffers_to_string(buffer_.data());
    buffer_.consume(buffer_.size());
    auto command = ParseCommand(text);
    if (!command) return Refuse(websocket::close_code::policy_error, command.error().message);
    command->viewer = id_;
    if (!server_.Queue(std::move(*command)))
      Notify(Notice("the simulation is busy; the last request was not taken"));
    Read();
  }

  void Refuse(websocket::close_code code, const std::string& reason) {
    closing_ = websocket::close_reason(code, reason.substr(0, 120));
    if (!writing_) Close();
  }

  void Close() {
    open_ = false;
    socket_.async_close(*closing_, [self = shared_from_this()](ErrorOf) {});
  }

  Detail& server_;
  websocket::stream<beast::tcp_stream, false> socket_;  // no compression: nothing leaves this machine
  int id_;
  beast::flat_buffer buffer_;
  bool open_ = false;
  std::optional<websocket::close_reason> closing_;
  Message writing_;
  std::deque<Message> sentences_;
  internal::Outbox outbox_;
};

// One HTTP connection, until it asks to become a WebSocket.
class LiveServer::Detail::Connection : public std::enable_shared_from_this<Connection> {
 public:
  Connection(Detail& server, tcp::socket&& socket) : server_(server), stream_(std::move(socket)) {}

  void Read() {
    parser_.emplace();
    parser_->header_limit(16 << 10);
    parser_->body_limit(server_.options.take_file ? kMaxFile : 4096);
    stream_.expires_after(std::chrono::seconds(20));
    http::async_read(stream_, buffer_, *parser_, [self = shared_from_this()](ErrorOf error, std::size_t) {
      if (!error) return self->Answer(self->parser_->release());
      if (const auto status = StatusOf(error)) self->Reject(*status);
    });
  }

 private:
  void Reject(http::status status) {
    http::request<http::string_body> unread{http::verb::get, "/", 11};
    unread.keep_alive(false);
    Send(unread, status, "text/plain", "This request cannot be used.\n");
  }

  void Answer(const http::request<http::string_body>& request) {
    if (!internal::IsLocal(View(request[http::field::host])) ||
        !internal::IsOwnOrigin(View(request[http::field::origin]), View(request[http::field::host])))
      return Send(request, http::status::forbidden, "text/plain",
                  "This viewer answers to pages of its own on this machine only.\n");
    const std::string_view target = View(request.target());
    if (!internal::IsAuthorized(target, server_.token))
      return Send(request, http::status::forbidden, "text/plain",
                  "The token is missing or wrong: open the whole address that the program printed, with its "
                  "?token=... A program that is started again has a new one.\n");
    const std::string_view path = target.substr(0, target.find('?'));
    if (websocket::is_upgrade(request)) {
      if (path != "/stream")
        return Send(request, http::status::not_found, "text/plain", "The stream is at /stream.\n");
      if (server_.viewers.size() >= server_.options.max_viewers)
        return Send(request, http::status::service_unavailable, "text/plain",
                    "Too many viewers; close one.\n");
      const int id = server_.next_viewer++;
      auto viewer = std::make_shared<Viewer>(server_, std::move(stream_), id);
      server_.viewers[id] = viewer;
      server_.num_viewers = static_cast<int>(server_.viewers.size());
      return viewer->Start(request);
    }
    if (request.method() == http::verb::put && server_.options.take_file) {
      const bool good = server_.options.take_file(std::string(path), request.body());
      return Send(request, good ? http::status::ok : http::status::internal_server_error, "text/plain", "");
    }
    if (request.method() != http::verb::get && request.method() != http::verb::head)
      return Send(request, http::status::method_not_allowed, "text/plain", "Only GET is answered.\n");
    if (path != "/" && path != "/index.html")
      return Send(request, http::status::not_found, "text/plain", "There is one page, at /.\n");
    Send(request, http::status::ok, "text/html; charset=utf-8", server_.options.page);
  }

  void Send(const http::request<http::string_body>& request, http::status status, const char* type,
            std::string_view body) {
    auto response = std::make_shared<http::response<http::span_body<const char>>>(status, request.version());
    response->set(http::field::content_type, type);
    response->set(http::field::cache_control, "no-store");
    response->set("X-Content-Type-Options", "nosniff");
    response->set("Referrer-Policy", "no-referrer");  // the address has the token
    response->set("X-Frame-Options", "DENY");
    response->keep_alive(request.keep_alive());
    response->body() = {body.data(), request.method() == http::verb::head ? 0 : body.size()};
    response->content_length(body.size());
    stream_.expires_after(std::chrono::seconds(20));
    http::async_write(stream_, *response, [self = shared_from_this(), response](ErrorOf error, std::size_t) {
      if (error) return;
      if (response->keep_alive()) return self->Read();
      ErrorOf ignored;
      self->stream_.socket().shutdown(tcp::socket::shutdown_send, ignored);
      self->stream_.expires_after(std::chrono::seconds(2));
      self->Drain();
    });
  }

  // What still comes is read: a socket that is closed with bytes in it takes back the answer too.
  void Drain() {
    buffer_.consume(buffer_.size());
    stream_.async_read_some(buffer_.prepare(4096), [self = shared_from_this()](ErrorOf error, std::size_t) {
      if (!error) self->Drain();
    });
  }

  Detail& server_;
  beast::tcp_stream stream_;
  beast::flat_buffer buffer_;
  std::optional<http::request_parser<http::string_body>> parser_;
};

void LiveServer::Detail::Accept() {
  acceptor->async_accept([this](ErrorOf error, tcp::socket socket) {
    if (error == asio::error::operation_aborted) return;
    if (error) {  // no descriptor is free, say: it will not be better at once
      pause->expires_after(std::chrono::milliseconds(100));
      return pause->async_wait([this](ErrorOf stopped) {
        if (!stopped) Accept();
      });
    }
    ErrorOf ignored;
    socket.set_option(tcp::no_delay(true), ignored);
    // The system would take megabytes for a page that reads slowly, and show it what was minutes ago.
    socket.set_option(asio::socket_base::send_buffer_size(64 << 10), ignored);
    std::make_shared<Connection>(*this, std::move(socket))->Read();
    Accept();
  });
}

void LiveServer::Detail::Drop(int viewer) {
  if (viewers.erase(viewer) == 0) return;
  num_viewers = static_cast<int>(viewers.size());
  Command left;
  left.kind = Command::Kind::kLeft;
  left.viewer = viewer;
  const std::lock_guard<std::mutex> lock(mutex);
  commands.PushAlways(left);  // at most one a viewer
}

bool LiveServer::Detail::Queue(Command command) {
  const std::lock_guard<std::mutex> lock(mutex);
  return commands.Push(std::move(command));
}

LiveServer::LiveServer() = default;
LiveServer::LiveServer(LiveServer&&) noexcept = default;
LiveServer& LiveServer::operator=(LiveServer&&) noexcept = default;

Expected<LiveServer> LiveServer::Create(const ServerOptions& options) {
  LiveServer server;
  server.detail_ = std::make_unique<Detail>(options);
  Detail& d = *server.detail_;
  if (options.require_token) {
    auto token = internal::MakeAccessToken();
    if (!token) return tl::unexpected(token.error());
    d.token = std::move(*token);
  }
  const tcp::endpoint endpoint(asio::ip::make_address("127.0.0.1"), options.port);
  ErrorOf error;
  d.acceptor->open(endpoint.protocol(), error);
  if (!error) d.acceptor->set_option(asio::socket_base::reuse_address(true), error);
  if (!error) d.acceptor->bind(endpoint, error);
  if (!error) d.acceptor->listen(asio::socket_base::max_listen_connections, error);
  if (error)
    return Fail(ErrorCode::kModel, fmt::format("port {}", options.port),
                "cannot be opened on 127.0.0.1 " +
                    CauseAndRemedy(error.value(), "choose another port, or 0 for any that is free"));
  d.Accept();
  d.thread = std::thread([&d] { d.context->run(); });
  return server;
}

LiveServer::~LiveServer() {
  if (!detail_) return;
  detail_->context->stop();
  if (detail_->thread.joinable()) detail_->thread.join();
}

unsigned short LiveServer::port() const {
  ErrorOf ignored;
  return detail_->acceptor->local_endpoint(ignored).port();
}

std::string LiveServer::address() const {
  const std::string page = fmt::format("http://127.0.0.1:{}/", port());
  return detail_->token.empty() ? page : page + "?token=" + detail_->token;
}

void LiveServer::Publish(Snapshot snapshot) {
  Detail& d = *detail_;
  {
    const std::lock_guard<std::mutex> lock(d.mutex);
    d.latest = std::move(snapshot);
  }
  if (d.notified.exchange(true)) return;  // the server thread has not come round yet
  asio::post(*d.context, [&d] {
    d.notified = false;
    for (auto& [id, viewer] : d.viewers)
      if (auto alive = viewer.lock()) alive->WriteNext();
  });
}

std::optional<Command> LiveServer::PopCommand() {
  const std::lock_guard<std::mutex> lock(detail_->mutex);
  return detail_->commands.Pop();
}

std::vector<Command> LiveServer::PopCommands() {
  std::vector<Command> out;
  while (auto command = PopCommand()) out.push_back(std::move(*command));
  return out;
}

void LiveServer::Detail::Notify(int viewer, Message message) {
  asio::post(*context, [this, viewer, message = std::move(message)] {
    for (auto& [id, weak] : viewers)
      if (viewer == 0 || id == viewer)
        if (auto alive = weak.lock()) alive->Notify(message);
  });
}

void LiveServer::Send(int viewer, const std::string& message) {
  detail_->Notify(viewer, std::make_shared<const std::string>(message));
}

void LiveServer::Notify(int viewer, const std::string& sentence) {
  detail_->Notify(viewer, Notice(sentence));
}

void LiveServer::SendProblem(int viewer, const std::string& about, const std::string& sentence) {
  detail_->Notify(viewer, std::make_shared<const std::string>(internal::ProblemMessage(about, sentence)));
}

int LiveServer::num_viewers() const { return detail_->num_viewers; }

}  // namespace fork1s
