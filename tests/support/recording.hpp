#pragma once
/// @file recording.hpp
/// Recordings made by tests, without a bus.
#include <cstdint>
#include <span>
#include <stdexcept>
#include <string>

#include "rtbus/messages.hpp"
#include "rtbus/recording/writer.hpp"

namespace tests {

/// What a segment of T would say about itself.
template <rtbus::Sample T>
rtbus::Segment::Description description_of() {
  const rtbus::SampleDescription type = rtbus::describe<T>();
  rtbus::Segment::Description out;
  out.type_name = type.type_name;
  out.type_hash = type.type_hash;
  out.sample_bytes = type.bytes;
  out.capacity = 64;
  for (const rtbus::Field& field : type.fields) {
    out.fields.push_back({std::string(field.name), std::string(field.unit), field.type, field.offset, field.count});
  }
  return out;
}

template <class T>
std::span<const std::byte> bytes_of(const T& sample) {
  return std::as_bytes(std::span(&sample, 1));
}

/// A recording of `haptic0.device_state` at 1 kHz, in which the hand stands still in the middle of its workspace.
inline void record_stillness(const std::string& file, double duration_s) {
  const auto check = [](const auto& result) {
    if (!result) throw std::runtime_error(result.error().message);
  };
  auto writer = rtbus::recording::Writer::create(file, {});
  check(writer);
  const auto topic = writer->add_topic("haptic0.device_state", description_of<rtbus::DeviceState>());
  check(topic);
  const auto ticks = static_cast<std::uint64_t>(duration_s * 1e3);
  for (std::uint64_t i = 1; i <= ticks; ++i) {
    rtbus::DeviceState state{};
    state.orientation_wxyz = {1, 0, 0, 0};
    state.sample_time_ns = i * 1'000'000;
    writer->append(*topic, i, i * 1'000'000, bytes_of(state));
  }
  check(writer->close());
}

}  // namespace tests
