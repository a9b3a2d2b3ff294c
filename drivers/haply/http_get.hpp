#pragma once
/// @file http_get.hpp
/// One HTTP request to a service on this machine. Over libwebsockets; no thread of its own.
#include <cstdint>
#include <string>

#include "drivers/io/stop_flag.hpp"

namespace drivers::haply {

/// GET http://`address`:`port``path`, waited for until the deadline. @returns the body of an answer 200; empty:
/// anything else. @realtime No.
[[nodiscard]] std::string http_get(const std::string& address, int port, const std::string& path,
                                   std::uint64_t deadline_ns, const io::StopFlag& stop);

}  // namespace drivers::haply
