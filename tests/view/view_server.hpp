#pragma once
/// @file view_server.hpp
/// `rtbus view` as a process of this build, and what a visitor without a browser says to it.
#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <optional>
#include <string>
#include <vector>

#include "tests/support/process.hpp"

namespace tests {

/// Ends with the object.
class ViewServer {
 public:
  /// @param session "": none is named. @param more Further words of its command line.
  explicit ViewServer(const std::string& session, std::vector<std::string> more = {}, int port = 0)
      : output_(std::string(testing::TempDir()) + "view_" + session + std::to_string(::getpid()) + ".txt") {
    std::vector<std::string> words{std::string(RTBUS_BINARY_DIR) + "/rtbus", "view", "--port", std::to_string(port)};
    if (!session.empty()) words.insert(words.end(), {"--session", session});
    words.insert(words.end(), more.begin(), more.end());
    process_.emplace(words, output_);
    eventually(10.0, [this] { return said().find('\n') != std::string::npos; });
    url_ = said().substr(0, said().find('\n'));
    const std::size_t host = url_.find("//"), end = url_.find('/', host + 2);
    if (host == std::string::npos || end == std::string::npos) return;
    host_ = url_.substr(host + 2, end - host - 2);
    port_ = std::atoi(host_.substr(host_.rfind(':') + 1).c_str());
    token_ = url_.substr(url_.find("k=") + 2);
  }
  ~ViewServer() {
    if (process_) process_->end(SIGTERM);
    ::unlink(output_.c_str());
  }
  ViewServer(const ViewServer&) = delete;
  ViewServer& operator=(const ViewServer&) = delete;

  /// All that it has printed.
  [[nodiscard]] std::string said() const {
    std::ifstream in(output_);
    return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
  }
  /// The address with options of the page: "low&theme=light".
  [[nodiscard]] std::string url(const std::string& options = "low&theme=light") const {
    return "http://" + host_ + "/?" + options + "#k=" + token_;
  }
  [[nodiscard]] const std::string& printed_url() const { return url_; }
  [[nodiscard]] const std::string& host() const { return host_; }
  [[nodiscard]] const std::string& token() const { return token_; }
  [[nodiscard]] int port() const { return port_; }
  Child& process() { return *process_; }

 private:
  std::string output_;
  std::optional<Child> process_;
  std::string url_, host_, token_;
  int port_ = 0;
};

/// A TCP connection to the server that says what it is told to.
class Visitor {
 public:
  explicit Visitor(int port) : fd_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(static_cast<std::uint16_t>(port));
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    const timeval patience{5, 0};
    ::setsockopt(fd_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    ::setsockopt(fd_, SOL_SOCKET, SO_SNDTIMEO, &patience, sizeof patience);
    connected_ = ::connect(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
  }
  ~Visitor() { ::close(fd_); }
  Visitor(const Visitor&) = delete;
  Visitor& operator=(const Visitor&) = delete;

  [[nodiscard]] int fd() const noexcept { return fd_; }
  /// @returns false when the server does not take it all.
  bool say(const std::string& bytes) {
    for (std::size_t done = 0; done < bytes.size();) {
      const ssize_t wrote = ::send(fd_, bytes.data() + done, bytes.size() - done, MSG_NOSIGNAL);
      if (wrote <= 0) return false;
      done += static_cast<std::size_t>(wrote);
    }
    return connected_;
  }
  /// What comes until the blank line after the headers, or until the end; "": nothing.
  std::string answer() {
    std::string text;
    for (char c = 0; text.find("\r\n\r\n") == std::string::npos && ::recv(fd_, &c, 1, 0) == 1;) text += c;
    return text;
  }
  /// Reads to the end of the connection. @returns false when it stays open for 5 s after the last byte.
  bool ends() {
    char bytes[65536];
    ssize_t got = 1;
    while ((got = ::recv(fd_, bytes, sizeof bytes, 0)) > 0) {
    }
    return got == 0 || errno == ECONNRESET;
  }

  /// The first line of the answer to a GET.
  static std::string get(int port, const std::string& path, const std::string& headers) {
    Visitor visitor(port);
    visitor.say("GET " + path + " HTTP/1.1\r\n" + headers + "\r\n");
    const std::string answer = visitor.answer();
    return answer.substr(0, answer.find("\r\n"));
  }
  /// Asks for the WebSocket. @returns the first line of the answer; "": the server hung up.
  std::string upgrade(const std::string& host, const std::string& origin) {
    say("GET /live HTTP/1.1\r\nHost: " + host + "\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n" +
        (origin.empty() ? "" : "Origin: " + origin + "\r\n") +
        "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n"
        "Sec-WebSocket-Protocol: rtbus-view-1\r\n\r\n");
    const std::string all = answer();
    return all.substr(0, all.find("\r\n"));
  }
  /// A text frame, masked with zeros.
  static std::string text_frame(const std::string& text) {
    std::string frame(1, static_cast<char>(0x81));
    const std::size_t size = text.size();
    if (size < 126) {
      frame += static_cast<char>(0x80 | size);
    } else {
      frame += static_cast<char>(0x80 | 127);
      for (int shift = 56; shift >= 0; shift -= 8) frame += static_cast<char>((size >> shift) & 0xff);
    }
    return frame + std::string(4, '\0') + text;
  }

 private:
  int fd_;
  bool connected_ = false;
};

}  // namespace tests
