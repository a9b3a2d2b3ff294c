#pragma once
/// @file live_error.hpp
/// The staleness error of a live run: the force rendered at each tick against the force that the same method gives with
/// the proxy that physics later published for that very instant. It is the force error of a slow or delayed physics;
/// zero for a link without delay.
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <optional>

#include "haptic_node/rendering/mapping.hpp"
#include "haptic_node/rendering/method.hpp"
#include "rtbus/messages.hpp"

namespace tools {

/// Root mean square and peak of a stream of magnitudes.
struct RmsPeak {
  double square_sum = 0.0;
  double peak = 0.0;
  std::uint64_t count = 0;

  void add(double magnitude) noexcept {
    square_sum += magnitude * magnitude;
    if (magnitude > peak) peak = magnitude;
    ++count;
  }
  [[nodiscard]] double rms() const noexcept;  ///< 0 when empty.
};

/// Fed with the ticks of one haptic node and the proxies that physics made for it, each in order of their time; the two
/// streams may run apart. Memory is bounded. Not thread-safe.
class LiveError {
 public:
  /// Makes an instance of the method that the haptic node follows, on a mapping that outlives it.
  using MakeMethod = std::function<std::unique_ptr<haptic::Method>(const haptic::Mapping& mapping)>;

  /// @param mapping As the haptic node starts with. @param dt_s Period of the loop.
  /// @param fixed_mapping Nothing ever shifts it (there is no clutch); else only the first mapping epoch is compared.
  LiveError(const haptic::MappingConfig& mapping, const MakeMethod& make_method, double dt_s,
            bool fixed_mapping = false);
  LiveError(const LiveError&) = delete;  // the method refers to our mapping
  LiveError& operator=(const LiveError&) = delete;

  void add_tick(const rtbus::Telemetry& tick);
  void add_proxy(const rtbus::ProxyState& proxy);

  [[nodiscard]] const RmsPeak& force_n() const noexcept { return force_n_; }  ///< |rendered − reference|.
  [[nodiscard]] const RmsPeak& position_m() const noexcept {
    return position_m_;
  }  ///< |proxy used − proxy of then|, in D.
  [[nodiscard]] std::uint64_t compared() const noexcept { return force_n_.count; }
  /// Ticks without a reference: force disabled, no proxy on both sides of the tick (physics away, run over, mapping
  /// re-based by the clutch in between).
  [[nodiscard]] std::uint64_t dropped() const noexcept { return dropped_ + ticks_.size(); }

 private:
  void compare(const rtbus::Telemetry& tick, const rtbus::ProxyState& before, const rtbus::ProxyState& after);
  [[nodiscard]] static bool neighbours(const rtbus::ProxyState& before, const rtbus::ProxyState& after) noexcept;

  haptic::Mapping mapping_;
  std::unique_ptr<haptic::Method> method_;
  double dt_s_;
  bool fixed_mapping_;
  std::optional<std::uint32_t> first_epoch_;
  std::deque<rtbus::Telemetry> ticks_;       ///< Wait for a proxy later than they are.
  std::optional<rtbus::ProxyState> before_;  ///< Newest proxy that is not later than the ticks that wait.
  RmsPeak force_n_, position_m_;
  std::uint64_t dropped_ = 0;
};

}  // namespace tools
