#include "tools/view/playback.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace view {

namespace {

/// A finite number of the object; else `otherwise`.
double number_of(const nlohmann::json& object, const char* key, double otherwise) {
  const auto found = object.find(key);
  if (found == object.end() || !found->is_number()) return otherwise;
  const double value = found->get<double>();
  return std::isfinite(value) ? value : otherwise;
}

}  // namespace

void Playback::take(const nlohmann::json& play, std::uint64_t now_ns) {
  if (!play.is_object()) return;
  advance(now_ns);
  speed_ = std::clamp(number_of(play, "speed", speed_), kSlowest, kFastest);
  if (const auto on = play.find("playing"); on != play.end() && on->is_boolean()) {
    playing_ = on->get<bool>();
    if (playing_ && at_s_ >= length_s_) go_to(0.0, true);
  }
  if (const double at_s = number_of(play, "at", -1.0); at_s >= 0.0) go_to(at_s, true);
  constexpr double kMost = 1000.0;
  if (const double steps = number_of(play, "step", 0.0); steps != 0.0) {
    playing_ = false;
    steps_ += static_cast<int>(std::clamp(steps, -kMost, kMost));
  }
}

void Playback::advance(std::uint64_t now_ns) {
  const std::uint64_t before_ns = std::exchange(advanced_ns_, std::max(advanced_ns_, now_ns));
  if (!playing_ || before_ns == 0 || now_ns <= before_ns) return;
  constexpr double kLongest_s = 0.25;  // nobody looked meanwhile: the picture goes on where it was
  const double passed_s = std::min(kLongest_s, static_cast<double>(now_ns - before_ns) * 1e-9);
  at_s_ = std::min(length_s_, at_s_ + speed_ * passed_s);
  if (at_s_ >= length_s_) playing_ = false;
}

void Playback::go_to(double at_s, bool jump) {
  at_s_ = std::clamp(at_s, 0.0, length_s_);
  if (jump) ++jumps_;
}

int Playback::take_steps() noexcept { return std::exchange(steps_, 0); }

}  // namespace view
