#pragma once
/// @file top_samples.hpp
/// Snapshots for the tests of `rtbus top`.
#include <algorithm>
#include <cstring>
#include <string>

#include "tools/cli/top/top_view.hpp"

namespace tests {

template <std::size_t N>
void set(rtbus::Text<N>& text, const char* value) {
  std::strncpy(text.data(), value, N - 1);
}

/// Ten seconds in which the force rose from 0 to 5 N and the hand moved 40 mm along x.
inline tools::RecentView recent() {
  tools::RecentView view;
  view.jitter = {0, 9000, 900, 90, 8, 0, 0, 1, 0, 1};
  view.ticks = 10'000;
  view.wakeup_max_us = 2500.0;
  for (int i = 0; i < 100; ++i) {
    view.force_n.push_back(0.05 * (i + 1));
    view.position_m.push_back({0.0004 * i, 0.0, 0.0});
  }
  return view;
}

inline tools::HapticView haptic(const std::string& name) {
  tools::HapticView view;
  view.name = name;
  view.life = {true, 0.01, 4242, 0, 60.0};
  view.info.emplace();
  set(view.info->role, "haptic");
  set(view.info->kind, "phantom_desktop");
  set(view.info->method, "remote_virtual_coupling");
  set(view.info->clock, "timer");
  set(view.info->scheduling, "SCHED_FIFO");
  set(view.info->realtime, "SCHED_FIFO 80, core 1, memory locked, cpu_dma_latency 0 us");
  set(view.info->left_out, "libusb, USB I/O thread, pipe thread, telemetry without an observer");
  view.info->force_limit_n = 8.0;
  view.info->core = 1;
  view.stats.emplace();
  view.stats->rate_hz = 1000.0;
  view.stats->achieved_hz = 999.9;
  view.stats->ticks = 123'456'789;
  view.stats->ticks_due = 123'456'800;
  view.stats->overruns = 11;
  view.stats->wakeup_p50_us = 14.0;
  view.stats->wakeup_max_us = 12'345.6;
  view.stats->proxy_age_p50_ms = 1.0;
  view.stats->force_peak_n = 6.0;
  view.stats->slew_limited = 7;
  view.device.emplace();
  view.device->position_m = {0.0123, -0.002, 0.0};
  view.device->buttons = 0b101;
  view.device->enabled = 1;
  view.force_n = 4.0;
  view.recent = recent();
  return view;
}

inline tools::TopSnapshot snapshot(int haptics = 1, int topics = 9) {
  tools::TopSnapshot snapshot;
  snapshot.session = "wall";
  snapshot.sessions = {"wall"};
  snapshot.uptime_s = 3725.0;
  for (int i = 0; i < haptics; ++i) snapshot.haptic.push_back(haptic("haptic" + std::to_string(i)));
  tools::PhysicsView physics;
  physics.name = "physics";
  physics.life = {true, 0.01, 4243, 0, 60.0};
  physics.stats.emplace();
  physics.stats->rate_hz = 18.0;
  physics.stats->achieved_hz = 18.0;
  snapshot.physics.push_back(physics);
  for (int i = 0; i < topics; ++i) {
    snapshot.topics.push_back({"haptic0.topic_" + std::to_string(i), 1000.0, 5, 4242, true, ""});
  }
  return snapshot;
}

inline std::string joined(const tools::Lines& lines) {
  std::string text;
  for (const tools::ViewLine& line : lines) text += line.text() + "\n";
  return text;
}

/// The overview without limits of size, in ASCII.
inline std::string all(const tools::TopSnapshot& of) { return joined(tools::overview_lines(of, {}, 0, 0)); }

/// The tone of the first part that contains `text`.
inline std::optional<tools::Tone> tone_at(const tools::Lines& lines, const std::string& text) {
  for (const tools::ViewLine& line : lines) {
    for (const auto& part : line.parts) {
      if (part.text.find(text) != std::string::npos) return part.tone;
    }
  }
  return std::nullopt;
}

}  // namespace tests
