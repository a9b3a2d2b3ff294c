#pragma once
/// @file wall_clock.hpp
/// The wall clock of programs that have libfault_wall_clock.so in LD_PRELOAD. libfaketime would do too, but it makes
/// threads of SCHED_FIFO spin.

namespace tools {

/// Names a file with one double: seconds that CLOCK_REALTIME, gettimeofday() and time() are ahead. It may change at any
/// time.
inline constexpr const char* kWallClockVariable = "RTBUS_FAULT_WALL_CLOCK";

}  // namespace tools
