#pragma once
// A sample type of one's own: fixed size, no pointers, every byte described by a field. Any tool can then print it.
#include "rtbus/messages.hpp"

struct ForceReading {
  rtbus::Vec3 force_n{};
  std::uint64_t sample_time_ns = 0;
};

template <>
struct rtbus::SampleTraits<ForceReading> {
  static constexpr std::string_view kName = "ForceReading";
  static constexpr std::array kFields{RTBUS_FIELD(ForceReading, force_n, "N"),
                                      RTBUS_FIELD(ForceReading, sample_time_ns, "ns")};
};
