#pragma once
/// @file fast_peer.hpp
/// A participant of another maker's DDS (Fast DDS). It knows no message type: it matches by names and copies bytes.
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace tests {

using Bytes = std::vector<std::uint8_t>;

/// A writer of somebody else's, as discovery tells.
struct FoundWriter {
  std::string type;
  std::string user_data;
  bool keyed = false;
  bool reliable = false;
  bool latched = false;
};

class FastPeer {
 public:
  /// In the network namespace of this process, over UDP alone: shared memory would leave files.
  explicit FastPeer(int domain = 0);
  ~FastPeer();
  FastPeer(const FastPeer&) = delete;
  FastPeer& operator=(const FastPeer&) = delete;

  /// @param topic "rt/haptic0/pose". @param reliable As most ROS 2 nodes ask; else as they do for sensors.
  void listen(const std::string& topic, const std::string& type, bool reliable = true, bool latched = false);
  [[nodiscard]] std::optional<Bytes> newest(const std::string& topic) const;  ///< With the encapsulation.
  [[nodiscard]] std::uint64_t received(const std::string& topic) const;

  /// By topic.
  [[nodiscard]] std::map<std::string, FoundWriter> writers() const;

  /// A writer, reliable as ROS 2's default is. @returns its number. Several may write one topic.
  [[nodiscard]] std::size_t announce(const std::string& topic, const std::string& type);
  [[nodiscard]] bool matched(std::size_t writer) const;
  void write(std::size_t writer, const Bytes& payload);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// "0001…"
[[nodiscard]] std::string hex(const Bytes& bytes);

}  // namespace tests
