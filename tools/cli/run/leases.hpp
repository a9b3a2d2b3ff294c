#pragma once
/// @file leases.hpp
/// What holds only while somebody renews it: the watch of a program that would stop the session, and gains that it has
/// ordered. No clock and no topic in here. Times are CLOCK_MONOTONIC.
#include <algorithm>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace tools {

/// One thread.
class Leases {
 public:
  /// `name` holds until then; a lease of that name is replaced.
  void renew(const std::string& name, std::uint64_t until_ns) {
    end(name);
    leases_.emplace_back(name, until_ns);
  }
  void end(const std::string& name) {
    std::erase_if(leases_, [&](const auto& each) { return each.first == name; });
  }
  /// Those whose time is over; each is told once.
  [[nodiscard]] std::vector<std::string> take_expired(std::uint64_t now_ns) {
    std::vector<std::string> out;
    for (const auto& [name, until_ns] : leases_) {
      if (now_ns >= until_ns) out.push_back(name);
    }
    for (const std::string& name : out) end(name);
    return out;
  }

 private:
  std::vector<std::pair<std::string, std::uint64_t>> leases_;
};

/// Who holds an E-stop. It is over when each of them has let go, or when everything is re-armed.
class Holders {
 public:
  void hold(const std::string& source) {
    if (!holds(source)) sources_.push_back(source);
  }
  void let_go(const std::string& source) { std::erase(sources_, source); }
  void clear() { sources_.clear(); }
  [[nodiscard]] bool any() const noexcept { return !sources_.empty(); }
  [[nodiscard]] bool holds(const std::string& source) const {
    return std::find(sources_.begin(), sources_.end(), source) != sources_.end();
  }
  [[nodiscard]] const std::vector<std::string>& all() const noexcept { return sources_; }

 private:
  std::vector<std::string> sources_;
};

}  // namespace tools
