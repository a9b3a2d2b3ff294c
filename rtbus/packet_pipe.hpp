#pragma once
/// @file packet_pipe.hpp
/// A duplex named pipe, as He & Choi (2013, section V.A) joined their processes: two POSIX FIFOs, one per direction.
/// For comparison with the bus; every read and write is a system call, so it has no place in a realtime thread.
///
/// Each packet is one Stamped<T> behind a header that names its type, shorter than PIPE_BUF, so that it arrives whole
/// or not at all (POSIX, write()). Nothing that is read is trusted: a header that does not fit empties the pipe, and a
/// sample that is not sane is dropped; both are counted.
#include <unistd.h>

#include <cstdint>
#include <cstring>
#include <string>

#include "rtbus/result.hpp"
#include "rtbus/sample.hpp"
#include "rtbus/sane_sample.hpp"
#include "rtbus/segment.hpp"

namespace rtbus {

/// One end. The server makes the FIFOs and removes them; the client finds them. Movable. One thread per end.
class PacketPipe {
 public:
  /// Makes `<name>` anew: what a dead server left under the name is replaced. The error is a sentence for the user.
  [[nodiscard]] static Result<PacketPipe, std::string> serve(const Session& session, const std::string& name);
  /// Fails, with a sentence, while no server is there.
  [[nodiscard]] static Result<PacketPipe, std::string> connect(const Session& session, const std::string& name);

  PacketPipe(PacketPipe&& other) noexcept;
  PacketPipe& operator=(PacketPipe&&) = delete;
  ~PacketPipe();

  /// Does not wait: a pipe that is full (nobody reads) or has no reader drops the packet. @returns whether it went.
  template <Sample T>
  bool send(const Stamped<T>& packet) noexcept {
    unsigned char bytes[sizeof(Header) + sizeof packet];
    static_assert(sizeof bytes <= 4096, "PIPE_BUF of Linux: longer packets may be torn");
    const Header header = header_of<T>();
    std::memcpy(bytes, &header, sizeof header);
    std::memcpy(bytes + sizeof header, &packet, sizeof packet);
    return write_packet(bytes, sizeof bytes);
  }

  /// Waits until a packet is there, at most until `deadline_ns`, then takes the newest one. @returns whether there was
  /// one.
  template <Sample T>
  bool receive_newest(std::uint64_t deadline_ns, Stamped<T>& out) noexcept {
    if (!wait_readable(deadline_ns)) return false;
    bool got = false;
    unsigned char bytes[sizeof(Header) + sizeof out];
    const Header expected = header_of<T>();
    while (read_packet(bytes, sizeof bytes)) {
      if (std::memcmp(bytes, &expected, sizeof expected) != 0) {
        ++refused_;
        drain();
        return got;
      }
      Stamped<T> packet;
      std::memcpy(&packet, bytes + sizeof expected, sizeof packet);
      if (!sane_stamp(packet.stamp_ns) || !sane(packet.value, packet.stamp_ns)) {
        ++refused_;
        continue;
      }
      out = packet;
      got = true;
    }
    return got;
  }

  /// Packets that were not sane, or no packets of this type, since this end was opened.
  [[nodiscard]] std::uint64_t refused() const noexcept { return refused_; }
  /// The other end has gone (client only); connect anew.
  [[nodiscard]] bool broken() const noexcept { return broken_; }

 private:
  struct Header {
    std::uint64_t magic = 0x3170692d73756274;  // "tbus-ip1"
    std::uint64_t type_hash = 0;
    std::uint64_t bytes = 0;
  };
  template <Sample T>
  static Header header_of() noexcept {
    Header header;
    header.type_hash = type_hash<T>();
    header.bytes = sizeof(Stamped<T>);
    return header;
  }
  PacketPipe(int in, int out, std::string folder, std::string name, bool server) noexcept;
  bool write_packet(const void* bytes, std::size_t size) noexcept;
  bool read_packet(void* bytes, std::size_t size) noexcept;
  bool wait_readable(std::uint64_t deadline_ns) const noexcept;
  void drain() noexcept;

  int in_ = -1;
  int out_ = -1;
  std::string path_;  ///< Without the direction.
  bool server_ = false;
  bool broken_ = false;
  std::uint64_t refused_ = 0;
};

}  // namespace rtbus
