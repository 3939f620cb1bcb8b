// The least of a WebSocket client, on plain sockets, so that a test can misbehave byte by byte.
#pragma once

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <optional>
#include <string>

namespace fork1s::test {

class SocketClient {
 public:
  /// `page`: http://127.0.0.1:PORT/?token=TOKEN
  explicit SocketClient(const std::string& page, int receive_buffer = 0)
      : query_(page.find('?') == std::string::npos ? "" : page.substr(page.find('?'))) {
    fd_ = socket(AF_INET, SOCK_STREAM, 0);
    if (receive_buffer > 0) setsockopt(fd_, SOL_SOCKET, SO_RCVBUF, &receive_buffer, sizeof receive_buffer);
    const timeval patience{5, 0};
    setsockopt(fd_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(static_cast<std::uint16_t>(std::atoi(page.c_str() + page.rfind(':') + 1)));
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    connected_ = connect(fd_, reinterpret_cast<sockaddr*>(&address), sizeof address) == 0;
  }
  ~SocketClient() { close(fd_); }
  SocketClient(const SocketClient&) = delete;
  SocketClient& operator=(const SocketClient&) = delete;

  bool connected() const { return connected_; }
  void Send(const std::string& bytes) { (void)!send(fd_, bytes.data(), bytes.size(), MSG_NOSIGNAL); }

  /// `path` with the token.
  std::string Target(const std::string& path) const { return path + query_; }
  /// Sends a request and returns the first line and headers of the answer.
  std::string Ask(const std::string& request) {
    Send(request);
    std::string answer;
    char c;
    while (answer.find("\r\n\r\n") == std::string::npos && recv(fd_, &c, 1, 0) == 1) answer += c;
    return answer;
  }
  std::string Upgrade(const std::string& extra = "", const std::string& host = "127.0.0.1") {
    return Ask("GET /stream" + query_ + " HTTP/1.1\r\nHost: " + host +
               "\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
               "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n" +
               extra + "\r\n");
  }

  /// A masked frame, as clients must send them.
  void SendFrame(int opcode, const std::string& payload) {
    std::string frame(1, static_cast<char>(0x80 | opcode));
    const std::size_t n = payload.size();
    if (n < 126) {
      frame += static_cast<char>(0x80 | n);
    } else {
      const int bytes = n < 65536 ? 2 : 8;
      frame += static_cast<char>(bytes == 2 ? 0xfe : 0xff);
      for (int i = bytes - 1; i >= 0; --i) frame += static_cast<char>(n >> (8 * i) & 0xff);
    }
    Send(frame + std::string(4, '\0') + payload);  // a mask of zeros
  }

  /// What comes until the server closes.
  std::string ReadBody() {
    std::string body;
    char c;
    while (recv(fd_, &c, 1, 0) == 1) body += c;
    return body;
  }

  struct Frame {
    int opcode = 0;
    std::string payload;
  };
  std::optional<Frame> ReadFrame() {
    unsigned char head[2];
    if (!Read(head, 2)) return {};
    std::uint64_t size = head[1] & 0x7f;
    if (size >= 126) {
      const int bytes = size == 126 ? 2 : 8;
      unsigned char more[8];
      if (!Read(more, static_cast<std::size_t>(bytes))) return {};
      size = 0;
      for (int i = 0; i < bytes; ++i) size = size << 8 | more[i];
    }
    Frame frame;
    frame.opcode = head[0] & 0xf;
    frame.payload.resize(size);
    if (size > 0 && !Read(reinterpret_cast<unsigned char*>(frame.payload.data()), size)) return {};
    return frame;
  }

  struct Close {
    int code = 0;
    std::string reason;
  };
  /// Reads on until the server closes.
  std::optional<Close> ReadClose() {
    while (auto frame = ReadFrame()) {
      if (frame->opcode != 8) continue;
      if (frame->payload.size() < 2) return Close{};
      const auto high = static_cast<unsigned char>(frame->payload[0]),
                 low = static_cast<unsigned char>(frame->payload[1]);
      return Close{high << 8 | low, frame->payload.substr(2)};
    }
    return {};
  }

 private:
  bool Read(unsigned char* out, std::size_t size) {
    while (size > 0) {
      const ssize_t got = recv(fd_, out, size, 0);
      if (got <= 0) return false;
      out += got;
      size -= static_cast<std::size_t>(got);
    }
    return true;
  }

  std::string query_;
  int fd_ = -1;
  bool connected_ = false;
};

}  // namespace fork1s::test
