#pragma once
/// @file node_log.hpp
/// Log output of a node: to stderr, without waiting for it. Otherwise a paused pager, a pipe without a reader, or a
/// terminal with Ctrl-S would block the logging thread, and with it a heartbeat or the end of the node. What stderr
/// does not take at once is dropped. Only main() files include this.
#include <poll.h>
#include <spdlog/sinks/ansicolor_sink.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <memory>
#include <string>

namespace rtbus {

/// True when a line (at most 4096 bytes, the size of an atomic write to a pipe) can be written without waiting.
[[nodiscard]] inline bool stderr_takes_a_line() noexcept {
  pollfd out{STDERR_FILENO, POLLOUT, 0};
  return ::poll(&out, 1, 0) == 1 && (out.revents & POLLOUT) != 0;
}

/// Coloured when stderr is a terminal.
class UnwaitingStderr final : public spdlog::sinks::ansicolor_stderr_sink_mt {
 public:
  void log(const spdlog::details::log_msg& message) override {
    if (stderr_takes_a_line()) spdlog::sinks::ansicolor_stderr_sink_mt::log(message);
  }
};

/// Makes that the default logger of this program.
inline void log_to_stderr(const std::string& program) {
  spdlog::set_default_logger(std::make_shared<spdlog::logger>(program, std::make_shared<UnwaitingStderr>()));
  spdlog::set_pattern("%H:%M:%S.%e %^%l%$ %v");
}

}  // namespace rtbus
