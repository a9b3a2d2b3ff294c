#include "rtbus/packet_pipe.hpp"

#include <fcntl.h>
#include <poll.h>
#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <utility>

#include "rtbus/clock.hpp"
#include "rtbus/private_folder.hpp"

namespace rtbus {

namespace {

std::string reason(const std::string& path) { return path + ": " + std::strerror(errno); }

}  // namespace

PacketPipe::PacketPipe(int in, int out, std::string folder, std::string name, bool server) noexcept
    : in_(in), out_(out), path_(std::move(folder) + "/" + std::move(name)), server_(server) {}

PacketPipe::PacketPipe(PacketPipe&& other) noexcept
    : in_(std::exchange(other.in_, -1)),
      out_(std::exchange(other.out_, -1)),
      path_(std::move(other.path_)),
      server_(std::exchange(other.server_, false)),
      broken_(other.broken_),
      refused_(other.refused_) {}

PacketPipe::~PacketPipe() {
  if (in_ >= 0) ::close(in_);
  if (out_ >= 0) ::close(out_);
  if (!server_) return;
  ::unlink((path_ + ".up").c_str());
  ::unlink((path_ + ".down").c_str());
}

Result<PacketPipe, std::string> PacketPipe::serve(const Session& session, const std::string& name) {
  const std::string folder = private_folder();
  if (folder.empty()) return Failure{std::string("no private folder for a pipe: set XDG_RUNTIME_DIR")};
  const std::string file = "rtbus." + session.name + "." + name;
  int ends[2] = {-1, -1};
  // "up" from the client, "down" to it. Opened for both directions, a FIFO neither blocks here nor hangs up when a
  // client goes.
  for (int i = 0; i < 2; ++i) {
    const std::string path = folder + "/" + file + (i == 0 ? ".up" : ".down");
    ::unlink(path.c_str());
    if (::mkfifo(path.c_str(), 0600) == 0) ends[i] = ::open(path.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC);
    if (ends[i] < 0) {
      std::string why = reason(path);
      if (ends[0] >= 0) ::close(ends[0]);
      return Failure{std::move(why)};
    }
  }
  return PacketPipe(ends[0], ends[1], folder, file, true);
}

Result<PacketPipe, std::string> PacketPipe::connect(const Session& session, const std::string& name) {
  const std::string folder = private_folder();
  if (folder.empty()) return Failure{std::string("no private folder for a pipe: set XDG_RUNTIME_DIR")};
  const std::string file = "rtbus." + session.name + "." + name;
  const std::string up = folder + "/" + file + ".up";
  const std::string down = folder + "/" + file + ".down";
  const int out = ::open(up.c_str(), O_WRONLY | O_NONBLOCK | O_CLOEXEC);  // ENXIO: nobody serves it
  if (out < 0) return Failure{reason(up)};
  const int in = ::open(down.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC);
  if (in < 0) {
    std::string why = reason(down);
    ::close(out);
    return Failure{std::move(why)};
  }
  return PacketPipe(in, out, folder, file, false);
}

bool PacketPipe::write_packet(const void* bytes, std::size_t size) noexcept {
  ssize_t put = 0;
  do {
    put = ::write(out_, bytes, size);
  } while (put < 0 && errno == EINTR);
  if (put < 0 && errno == EPIPE) broken_ = true;
  return put == static_cast<ssize_t>(size);
}

bool PacketPipe::read_packet(void* bytes, std::size_t size) noexcept {
  ssize_t got = 0;
  do {
    got = ::read(in_, bytes, size);
  } while (got < 0 && errno == EINTR);
  if (got == 0 && !server_) broken_ = true;            // the server has closed its end
  if (got > 0 && got != static_cast<ssize_t>(size)) {  // another program's bytes: find the border again
    ++refused_;
    drain();
  }
  return got == static_cast<ssize_t>(size);
}

bool PacketPipe::wait_readable(std::uint64_t deadline_ns) const noexcept {
  const std::uint64_t now_ns = monotonic_ns();
  const std::uint64_t left_ns = deadline_ns > now_ns ? deadline_ns - now_ns : 0;
  const timespec left{static_cast<time_t>(left_ns / kNsPerS), static_cast<long>(left_ns % kNsPerS)};
  pollfd end{in_, POLLIN, 0};
  return ::ppoll(&end, 1, &left, nullptr) == 1 && (end.revents & (POLLIN | POLLHUP)) != 0;
}

void PacketPipe::drain() noexcept {
  char bytes[4096];
  for (int i = 0; i < 64 && ::read(in_, bytes, sizeof bytes) > 0; ++i) {
  }
}

}  // namespace rtbus
