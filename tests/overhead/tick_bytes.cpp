/// Bytes and pages that a tick of the haptic loop touches, of data and of code. tick_bytes.sh runs it under valgrind.
#include <algorithm>
#include <charconv>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>
#include <string_view>
#include <unordered_set>
#include <vector>

#include "haptic_node/loop.hpp"
#include "rtbus/config/session.hpp"
#include "tools/evaluation/local_contact/local_contact.hpp"
#include "tools/harness/harness.hpp"

namespace {

constexpr std::uint64_t kLine_bytes = 64;  // of a cache
constexpr std::uint64_t kLinesOfPage = 64;

/// Where the code of Loop::cycle() begins.
std::uint64_t cycle_address() {
  auto cycle = &haptic::Loop::cycle;  // not virtual: the first word is the address (Itanium C++ ABI, 2.3)
  std::uint64_t out = 0;
  static_assert(sizeof cycle >= sizeof out);
  std::memcpy(&out, &cycle, sizeof out);
  return out;
}

/// One session under the simulated clock.
void run(const std::string& file, double duration_s, const std::vector<std::string>& assignments) {
  std::vector<rtbus::config::Override> overrides;
  for (const std::string& each : assignments) overrides.push_back(rtbus::config::parse_override(each));
  auto session = rtbus::config::load_session(file, overrides);
  tools::Harness harness(session, {});
  double largest_n = 0.0;
  harness.run(duration_s,
              [&](const rtbus::Telemetry& tick) { largest_n = std::max(largest_n, tools::norm(tick.force_n)); });
  std::fprintf(stderr, "largest force %.2f N\n", largest_n);
}

/// Distinct lines and pages of each tick.
struct Touched {
  std::unordered_set<std::uint64_t> now;  ///< Lines of the tick that is running.
  std::vector<std::uint64_t> lines, pages;

  void end_tick(bool counts) {
    std::unordered_set<std::uint64_t> distinct;
    for (const std::uint64_t line : now) distinct.insert(line / kLinesOfPage);
    if (counts) lines.push_back(now.size()), pages.push_back(distinct.size());
    now.clear();
  }
};

std::uint64_t percentile(std::vector<std::uint64_t> values, double share) {
  if (values.empty()) return 0;
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

/// Reads a trace of lackey: "I  ADDRESS,SIZE" is an instruction, " L", " S" and " M" are loads, stores and both.
int count(std::uint64_t cycle, std::size_t first_tick) {
  Touched code, data;
  std::uint64_t last_end = 0, returns_to = 0;
  std::size_t tick = 0;
  bool inside = false;
  char text[128];
  while (std::fgets(text, sizeof text, stdin) != nullptr) {
    const std::string_view line(text);
    const std::size_t comma = line.find(',');
    if (line.size() < 6 || line[2] != ' ' || comma == std::string_view::npos) continue;
    std::uint64_t address = 0, size = 0;
    if (std::from_chars(text + 3, text + comma, address, 16).ec != std::errc{}) continue;
    if (std::from_chars(text + comma + 1, text + line.size(), size).ec != std::errc{}) continue;
    const bool instruction = line[0] == 'I';
    if (instruction && address == cycle) {
      inside = true;
      returns_to = last_end;
    } else if (instruction && inside && address == returns_to) {
      inside = false;
      code.end_tick(tick >= first_tick);
      data.end_tick(tick >= first_tick);
      ++tick;
    }
    if (instruction) last_end = address + size;
    if (!inside) continue;
    for (std::uint64_t at = address / kLine_bytes; at <= (address + size - 1) / kLine_bytes; ++at) {
      (instruction ? code : data).now.insert(at);
    }
  }
  std::printf("%zu", data.lines.size());
  for (const Touched* each : {&data, &code}) {
    for (const double share : {0.5, 0.99}) std::printf("\t%lu", percentile(each->lines, share) * kLine_bytes);
    for (const double share : {0.5, 0.99}) std::printf("\t%lu", percentile(each->pages, share));
  }
  std::printf("\n");
  return data.lines.empty() ? 1 : 0;
}

}  // namespace

int main(int argc, char** argv) {
  const std::vector<std::string> words(argv + 1, argv + argc);
  if (words.size() == 1 && words[0] == "address") {
    std::printf("%lx\n", cycle_address());
    return 0;
  }
  if (words.size() == 3 && words[0] == "bumps") {
    tools::write_bumps(words[1], std::atoi(words[2].c_str()));
    return 0;
  }
  if (words.size() == 3 && words[0] == "count") {
    return count(std::strtoull(words[1].c_str(), nullptr, 16), std::strtoull(words[2].c_str(), nullptr, 10));
  }
  if (words.size() >= 3 && words[0] == "run") {
    run(words[1], std::atof(words[2].c_str()), {words.begin() + 3, words.end()});
    return 0;
  }
  std::fprintf(stderr, "usage: see tick_bytes.sh\n");
  return 2;
}
