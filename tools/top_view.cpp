#include "tools/top_view.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <string_view>
#include <utility>

namespace tools {

namespace {

using Lines = std::vector<ViewLine>;

/// Older than this a heartbeat (every 20 ms) counts as lost, as the haptic node judges it.
constexpr double kHeartbeatLost_s = 0.06;

[[gnu::format(printf, 1, 2)]] std::string print(const char* format, ...) {
  char text[512];
  va_list arguments;
  va_start(arguments, format);
  std::vsnprintf(text, sizeof text, format, arguments);
  va_end(arguments);
  return text;
}

unsigned long long count(std::uint64_t value) { return value; }

std::string duration(double seconds) {
  const auto whole = static_cast<long long>(std::max(0.0, seconds));
  return print("%02lld:%02lld:%02lld", whole / 3600, whole / 60 % 60, whole % 60);
}

Tone tone_of(const NodeLife& life) {
  if (!life.writer_alive) return Tone::kBad;
  if (!life.heartbeat_age_s) return Tone::kWarn;
  return *life.heartbeat_age_s > kHeartbeatLost_s ? Tone::kBad : Tone::kHeading;
}

std::string on_core(const rtbus::NodeInfo& info) {
  return info.core == 0xffffffffu ? std::string("any core") : "core " + std::to_string(info.core);
}

/// "FIFO" or "OTHER": the prefix SCHED_ costs the room that the clock needs.
std::string scheduling(const rtbus::NodeInfo& info) {
  const std::string name = text_of(info.scheduling);
  return name.starts_with("SCHED_") ? name.substr(6) : name;
}

/// "[######....|]": how much of the limit is used; the mark is the peak since start.
std::string bar(double value, double peak, double limit, int width) {
  std::string text(static_cast<std::size_t>(width), '.');
  if (!(limit > 0.0)) return "[" + text + "]";
  // Clamped before it becomes a whole number; what is no number counts as full, so that it never looks harmless.
  const auto cells = [&](double of) {
    return static_cast<int>(std::lround(std::isnan(of) ? width : std::clamp(of / limit, 0.0, 1.0) * width));
  };
  std::fill_n(text.begin(), cells(value), '#');
  if (const int mark = cells(peak); mark > 0) {
    text[static_cast<std::size_t>(mark - 1)] = '|';
  }
  return "[" + text + "]";
}

/// A force in a few characters, whatever it is.
std::string newtons(double force_n) {
  return std::abs(force_n) < 1e4 ? print("%.2f", force_n) : print("%.2g", force_n);
}

/// The rungs of the safety ladder that have acted, in ticks.
std::string safety_text(const rtbus::LoopStats& stats) {
  const std::pair<const char*, std::uint64_t> rungs[] = {
      {"clamped", stats.clamped},           {"slew", stats.slew_limited},      {"stale", stats.stale_ticks},
      {"nonfinite", stats.nonfinite},       {"overspeed", stats.overspeed},    {"thermal", stats.thermal_limited},
      {"passivity", stats.passivity_ticks}, {"device_lost", stats.device_lost}};
  std::string text;
  for (const auto& [name, ticks] : rungs) {
    if (ticks > 0) text += print("%s%s %llu", text.empty() ? "" : "  ", name, count(ticks));
  }
  return text.empty() ? "nothing acted" : text + " (ticks)";
}

void add_force(Lines& lines, const HapticView& view) {
  const rtbus::LoopStats& stats = *view.stats;
  const double limit_n = view.info ? view.info->force_limit_n : 0.0;
  const double now_n = view.force_n.value_or(stats.force_rms_n);
  // "now" is the RMS of the last fraction of a second; without two statistics it is the one since start.
  lines.push_back(
      {print("  force     %s %s %s of %.1f N  rms %s  peak %s N", bar(now_n, stats.force_peak_n, limit_n, 20).c_str(),
             view.force_n ? "now" : "mean", newtons(now_n).c_str(), limit_n, newtons(stats.force_rms_n).c_str(),
             newtons(stats.force_peak_n).c_str()),
       limit_n > 0.0 && !(now_n <= 0.95 * limit_n) ? Tone::kWarn : Tone::kPlain});
}

void add_timing(Lines& lines, const rtbus::LoopStats& stats) {
  const double share =
      stats.ticks_due > 0 ? 100.0 * static_cast<double>(stats.overruns) / static_cast<double>(stats.ticks_due) : 0.0;
  const bool measured = stats.achieved_hz > 0.0;
  const bool slow = measured && stats.achieved_hz < 0.99 * stats.rate_hz;
  lines.push_back({print("  rate      %s of %.0f Hz   ticks %llu   overruns %llu (%.3f %%)",
                         measured ? print("%.1f", stats.achieved_hz).c_str() : "-", stats.rate_hz, count(stats.ticks),
                         count(stats.overruns), share),
                   slow ? Tone::kWarn : Tone::kPlain});
  lines.push_back({print("  wake-up   p50 %.1f  p99 %.1f  max %.1f us   compute p50 %.1f p99 %.1f max %.1f",
                         stats.wakeup_p50_us, stats.wakeup_p99_us, stats.wakeup_max_us, stats.compute_p50_us,
                         stats.compute_p99_us, stats.compute_max_us)});
}

void add_proxy_age(Lines& lines, const rtbus::LoopStats& stats) {
  lines.push_back(
      {print("  proxy age p50 %.2f  p99 %.2f  max %.1f ms   device i/o p50 %.1f p99 %.1f us", stats.proxy_age_p50_ms,
             stats.proxy_age_p99_ms, stats.proxy_age_max_ms, stats.device_p50_us, stats.device_p99_us)});
}

void add_position(Lines& lines, const rtbus::DeviceState& device) {
  const rtbus::Vec3& p = device.position_m;
  const rtbus::Vec3& v = device.velocity_m_s;
  std::string pressed;
  for (unsigned i = 0; i < 32; ++i) {
    if ((device.buttons >> i & 1u) != 0) pressed += " " + std::to_string(i);
  }
  lines.push_back({print("  position  %+.1f %+.1f %+.1f mm   speed %.3f m/s   buttons%s   %s", p[0] * 1e3, p[1] * 1e3,
                         p[2] * 1e3, std::hypot(v[0], v[1], v[2]), pressed.empty() ? " -" : pressed.c_str(),
                         device.enabled != 0 ? "forces on" : "forces OFF")});
}

void add_safety(Lines& lines, const HapticView& view) {
  const rtbus::LoopStats& stats = *view.stats;
  const bool serious = stats.nonfinite > 0 || stats.overspeed > 0 || stats.device_lost > 0;
  std::string text = "  safety    " + safety_text(stats);
  if (stats.losses > 0) {
    text += print("   physics lost %llu x", count(stats.losses));
    if (view.loss_age_s) text += print(", last %.0f s ago", *view.loss_age_s);
  }
  lines.push_back({text, serious ? Tone::kWarn : Tone::kPlain});
}

void add_energy(Lines& lines, const rtbus::LoopStats& stats) {
  // Made energy is what passivity must prevent: say it in words, the sign alone is easily overlooked.
  lines.push_back({print("  energy    %s %.2g J %s the hand, %.2g J removed by passivity",
                         stats.energy_absorbed_j < 0.0 ? "MADE" : "absorbed", std::abs(stats.energy_absorbed_j),
                         stats.energy_absorbed_j < 0.0 ? "against" : "from", stats.energy_removed_j),
                   stats.energy_absorbed_j < 0.0 ? Tone::kWarn : Tone::kPlain});
}

/// @param compact Only what tells whether all is well.
void add_haptic(Lines& lines, const HapticView& view, bool compact) {
  std::string head = view.name + " " + life_text(view.life);
  if (view.info) {
    const rtbus::NodeInfo& info = *view.info;
    // What a narrow window cuts off stands last.
    head += ": " + text_of(info.kind) + ", " + text_of(info.method) + ", " + scheduling(info) + " " + on_core(info) +
            ", " + text_of(info.clock);
  }
  lines.push_back({head, tone_of(view.life)});
  if (view.stats) add_timing(lines, *view.stats);
  if (view.stats && !compact) add_proxy_age(lines, *view.stats);
  if (view.stats) add_force(lines, view);
  if (view.device && !compact) add_position(lines, *view.device);
  if (view.stats && !compact) add_energy(lines, *view.stats);
  if (view.stats) add_safety(lines, view);
}

void add_physics(Lines& lines, const PhysicsView& view) {
  std::string head = view.name + " " + life_text(view.life);
  if (view.info) {
    head +=
        ": " + text_of(view.info->kind) + ", " + text_of(view.info->clock) + print(", %u bodies", view.info->bodies);
  }
  lines.push_back({head, tone_of(view.life)});
  if (!view.stats) return;
  const rtbus::StepStats& stats = *view.stats;
  lines.push_back({print("  rate      %.1f of %.0f Hz   steps %llu of %llu   late %llu   simulated %.1f s",
                         stats.achieved_hz, stats.rate_hz, count(stats.steps), count(stats.due), count(stats.late),
                         stats.simulated_s)});
  lines.push_back(
      {print("  step      p50 %.3f  p99 %.3f  max %.3f ms", stats.step_p50_ms, stats.step_p99_ms, stats.step_max_ms)});
}

std::string topic_cell(const TopicView& topic, int name_width) {
  if (!topic.problem.empty()) return print("  %-*s %s", name_width, topic.name.c_str(), topic.problem.c_str());
  const std::string rate = topic.rate_hz && topic.writer_alive ? print("%.1f", *topic.rate_hz) : "-";
  return print("  %-*s %9s %11llu %8u%s", name_width, topic.name.c_str(), rate.c_str(), count(topic.published),
               topic.writer_pid, topic.writer_alive ? "" : " dead");
}

/// @param room Lines there are, the heading among them; negative: any number.
void add_topics(Lines& lines, const std::vector<TopicView>& topics, int room) {
  if (topics.empty() || room == 0 || room == 1) return;
  std::size_t name_width = 20;
  for (const TopicView& topic : topics) name_width = std::max(name_width, topic.name.size());
  const int columns = static_cast<int>(std::min<std::size_t>(name_width, 40));
  lines.push_back({print("%-*s %9s %11s %8s", columns + 2, "topics", "Hz", "published", "writer"), Tone::kHeading});
  std::size_t shown = topics.size();
  if (room > 0 && static_cast<int>(shown) > room - 1) shown = static_cast<std::size_t>(room - 2);
  for (std::size_t i = 0; i < shown; ++i) {
    const bool bad = !topics[i].writer_alive || !topics[i].problem.empty();
    lines.push_back({topic_cell(topics[i], columns), bad ? Tone::kBad : Tone::kPlain});
  }
  if (shown < topics.size()) lines.push_back({print("  + %zu more: rtbus list", topics.size() - shown), Tone::kDim});
}

/// Breaks `text` at blanks into lines of at most `width` characters; 0: one line.
void add_wrapped(Lines& lines, std::string_view text, int width) {
  const auto limit = static_cast<std::size_t>(width);
  while (limit > 0 && text.size() > limit) {
    const std::size_t blank = text.rfind(' ', limit);
    const bool usable = blank != std::string_view::npos && blank > 0;
    lines.push_back({std::string(text.substr(0, usable ? blank : limit))});
    text.remove_prefix(usable ? blank + 1 : limit);
  }
  lines.push_back({std::string(text)});
}

Lines header(const TopSnapshot& snapshot, int width) {
  if (snapshot.session.empty()) {
    Lines lines = {{"rtbus top", Tone::kHeading}};
    add_wrapped(lines, snapshot.message, width);
    return lines;
  }
  return {{print("rtbus top  session %s  up %s  %zu haptic, %zu physics, %zu topics%s", snapshot.session.c_str(),
                 duration(snapshot.uptime_s).c_str(), snapshot.haptic.size(), snapshot.physics.size(),
                 snapshot.topics.size(), snapshot.paused ? "  PAUSED" : ""),
           Tone::kHeading}};
}

Lines nodes(const TopSnapshot& snapshot, bool compact) {
  Lines lines;
  for (const HapticView& view : snapshot.haptic) add_haptic(lines, view, compact);
  for (const PhysicsView& view : snapshot.physics) add_physics(lines, view);
  return lines;
}

/// Cuts or fills `lines` to the window and puts `footer` on its last line.
void fit(Lines& lines, int width, int height, const char* footer) {
  if (height > 0) {
    lines.resize(static_cast<std::size_t>(std::max(0, height - 1)));
    lines.push_back({footer, Tone::kDim});
  }
  for (ViewLine& line : lines) {
    if (width > 0 && line.text.size() > static_cast<std::size_t>(width))
      line.text.resize(static_cast<std::size_t>(width));
  }
}

}  // namespace

std::string life_text(const NodeLife& life) {
  if (!life.writer_alive) return "GONE";
  if (!life.heartbeat_age_s) return "starting";
  return *life.heartbeat_age_s > kHeartbeatLost_s ? print("STALE %.2f s", *life.heartbeat_age_s) : "alive";
}

std::optional<double> force_between(const rtbus::LoopStats& before, const rtbus::LoopStats& now) {
  if (now.ticks <= before.ticks) return std::nullopt;
  const auto square_sum = [](const rtbus::LoopStats& stats) {
    return stats.force_rms_n * stats.force_rms_n * static_cast<double>(stats.ticks);
  };
  // Rounding may leave a tiny negative difference when no force acted.
  const double difference = std::max(0.0, square_sum(now) - square_sum(before));
  return std::sqrt(difference / static_cast<double>(now.ticks - before.ticks));
}

std::vector<ViewLine> top_lines(const TopSnapshot& snapshot, int width, int height) {
  Lines lines = header(snapshot, width);
  if (!snapshot.session.empty()) {
    const int body = height > 0 ? height - static_cast<int>(lines.size()) - 1 : -1;
    Lines middle = nodes(snapshot, false);
    if (body >= 0 && static_cast<int>(middle.size()) > body) middle = nodes(snapshot, true);
    const int room = body < 0 ? -1 : std::max(0, body - static_cast<int>(middle.size()));
    lines.insert(lines.end(), middle.begin(), middle.end());
    add_topics(lines, snapshot.topics, room);
  }
  fit(lines, width, height, "q quit   p pause   ? help");
  return lines;
}

std::vector<ViewLine> help_lines(int width, int height) {
  Lines lines = {{"rtbus top: read-only monitor; it cannot disturb what it watches", Tone::kHeading},
                 {""},
                 {"  q  quit        p  pause (the nodes go on)        ?  this page"},
                 {""},
                 {"alive      heartbeat younger than 60 ms"},
                 {"STALE      process stopped, starved or in a debugger: forces fade to zero"},
                 {"GONE       process has died; `rtbus clean` removes what it left"},
                 {"rate       reached in the last second, of the rate asked for"},
                 {"overruns   periods without a cycle since start"},
                 {"wake-up    how late cycles begin; percentiles since start"},
                 {"compute    force law and safety, without the device"},
                 {"proxy age  age of the physics answer that a force is made from"},
                 {"force      RMS of the last fraction of a second against the limit;"},
                 {"           | is the peak since start"},
                 {"energy     work of the hand on the device's force; MADE: the device pushed"},
                 {"           more than it took, which the passivity damper works against"},
                 {"safety     ticks in which a rung of the safety ladder changed the force"},
                 {"late       physics steps that took longer than their period"}};
  fit(lines, width, height, "any key: back");
  return lines;
}

}  // namespace tools
