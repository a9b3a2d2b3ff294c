#pragma once
/// @file interrupt.hpp
/// Ctrl-C, SIGTERM and SIGHUP (the terminal is gone) as a flag that every command asks, so that each one ends its own
/// way: children stopped, terminal restored, last figures printed.
#include <cstdint>

namespace tools {

/// From now on SIGINT, SIGTERM and, unless it is ignored, SIGHUP only raise the flag. Called once by main, before any
/// command runs. Blocking system calls return with EINTR (no SA_RESTART), so that nobody sleeps through a Ctrl-C.
void catch_interrupts() noexcept;

/// A signal has come since catch_interrupts(). Any thread; async-signal-safe.
[[nodiscard]] bool interrupted() noexcept;

/// How many have come: a command that takes long to end may hurry at the second one.
[[nodiscard]] int interrupt_count() noexcept;

/// The last signal that came (SIGINT, SIGTERM or SIGHUP); 0: none.
[[nodiscard]] int interrupt_signal() noexcept;

/// Sleeps for `duration_ns` or until a signal comes. @return false when it was interrupted, also before the call.
bool sleep_unless_interrupted(std::uint64_t duration_ns) noexcept;

}  // namespace tools
