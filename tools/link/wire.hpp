#pragma once
/// @file wire.hpp
/// The link's place on DDS: one participant that speaks with the addresses named in the session, and with no others.
#include <dds/dds.h>

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "rtbus/result.hpp"
#include "tools/dds/participant.hpp"
#include "tools/link/peers.hpp"

namespace link_dds {

/// A packet's head (link_messages.idl).
struct Head {
  std::uint64_t life = 0, sequence = 0, sent_ns = 0, echo_ns = 0, held_ns = 0;
};

class PacketWriter {
 public:
  void send(const Head& head, std::span<const std::uint8_t> body) noexcept;

 private:
  friend class Wire;
  explicit PacketWriter(dds_entity_t writer) : writer_(writer) {}
  dds_entity_t writer_;
};

class PacketReader {
 public:
  /// Hands what has come to `take`.
  void drain(const std::function<void(const Head& head, std::span<const std::uint8_t> body)>& take);

 private:
  friend class Wire;
  explicit PacketReader(dds_entity_t reader) : reader_(reader) {}
  dds_entity_t reader_;
};

class Wire {
 public:
  /// @param own Address of this machine's interface. @param others Of the other machines. The error is a sentence for
  /// the user. The threads of Cyclone DDS inherit the CPUs of the calling thread.
  [[nodiscard]] static rtbus::Result<Wire, std::string> open(int domain, const std::string& own,
                                                             const std::vector<std::string>& others);
  /// Streams are best effort and keep the newest; what is reliable is repeated until it has come.
  [[nodiscard]] rtbus::Result<PacketWriter, std::string> writer(const std::string& topic, bool reliable);
  [[nodiscard]] rtbus::Result<PacketReader, std::string> reader(const std::string& topic, bool reliable);

  void greet(const PeerHello& hello);
  void hear(const std::function<void(const PeerHello& hello)>& take);

  /// Sleeps until something has come for a reader, at most `timeout_ns`.
  void wait(std::uint64_t timeout_ns);

 private:
  explicit Wire(tools::dds::Participant participant) : participant_(std::move(participant)) {}
  [[nodiscard]] rtbus::Result<void, std::string> prepare();
  tools::dds::Participant participant_;
  dds_entity_t hello_writer_ = 0, hello_reader_ = 0, waitset_ = 0;
};

}  // namespace link_dds
