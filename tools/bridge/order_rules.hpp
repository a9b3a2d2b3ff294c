#pragma once
/// @file order_rules.hpp
/// What becomes of messages that come from ROS 2 before they are orders: who may give them, how often, how far. No DDS
/// and no clock in here. Times are CLOCK_MONOTONIC.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>

#include "rtbus/clock.hpp"

namespace bridge {

/// Names who wrote a message, alike for all of his messages.
using Author = std::uint64_t;

/// Who speaks first owns the topic, until he has been silent for the time-out and lost() has said so. Others are
/// refused meanwhile: nobody takes over a topic whose owner's silence has not been answered.
class Owner {
 public:
  explicit Owner(double timeout_s) : timeout_ns_(rtbus::ns_of(timeout_s)) {}

  /// A message has come. @returns whether it counts.
  bool hears(Author author, std::uint64_t now_ns) {
    if (author_ && *author_ != author) return false;
    author_ = author;
    heard_ns_ = now_ns;
    return true;
  }
  /// True once, when the owner has fallen silent: then there is none.
  bool lost(std::uint64_t now_ns) {
    if (!author_ || !silent(now_ns)) return false;
    author_.reset();
    return true;
  }

  [[nodiscard]] bool is(Author author) const { return author_ == author; }
  /// How long he may still be silent; 0: there is none.
  [[nodiscard]] double left_s(std::uint64_t now_ns) const {
    return author_ && !silent(now_ns) ? rtbus::seconds_between(now_ns, heard_ns_ + timeout_ns_) : 0.0;
  }

 private:
  [[nodiscard]] bool silent(std::uint64_t now_ns) const { return now_ns > heard_ns_ + timeout_ns_; }
  std::uint64_t timeout_ns_;
  std::optional<Author> author_;
  std::uint64_t heard_ns_ = 0;
};

/// At most so many per second.
class Pace {
 public:
  explicit Pace(double per_s) : gap_ns_(rtbus::ns_of(1.0 / per_s)) {}
  /// Once more, if there has been a pause.
  bool allows(std::uint64_t now_ns) {
    if (last_ns_ && now_ns < *last_ns_ + gap_ns_) return false;
    last_ns_ = now_ns;
    return true;
  }

 private:
  std::uint64_t gap_ns_;
  std::optional<std::uint64_t> last_ns_;
};

/// What a message makes of a session.
enum class Verdict : std::uint8_t {
  kNothing,  ///< It changes nothing: a beat.
  kOrder,    ///< Order it.
  kRearm,
  kRefused,  ///< Not from the owner, too often, or no number.
};

/// `estop`, std_msgs/Bool: true, from anybody, stops. Who sends false watches over the session: his silence stops it
/// too.
class EstopRule {
 public:
  explicit EstopRule(double timeout_s) : owner_(timeout_s) {}
  Verdict hears(bool stop, Author author, std::uint64_t now_ns) {
    if (!stop) return owner_.hears(author, now_ns) ? Verdict::kNothing : Verdict::kRefused;
    if (owner_.is(author)) (void)owner_.hears(author, now_ns);
    return Verdict::kOrder;
  }
  bool stops_by_silence(std::uint64_t now_ns) { return owner_.lost(now_ns); }
  [[nodiscard]] double watched_for_s(std::uint64_t now_ns) const { return owner_.left_s(now_ns); }

 private:
  Owner owner_;
};

/// `enable`, std_msgs/Bool, repeated by its owner: false, or silence, stops. Only the step from false to true takes
/// that back, at most twice a second. An E-stop by somebody else stays.
class EnableRule {
 public:
  explicit EnableRule(double timeout_s) : owner_(timeout_s) {}
  Verdict hears(bool enable, Author author, std::uint64_t now_ns) {
    if (!owner_.hears(author, now_ns)) return Verdict::kRefused;
    const bool before = std::exchange(enabled_, enable);
    if (enable && seen_false_ && !before) return rearms_.allows(now_ns) ? Verdict::kRearm : refuse();
    const bool first_false = !enable && (before || !seen_false_);
    seen_false_ = seen_false_ || !enable;
    return first_false ? Verdict::kOrder : Verdict::kNothing;
  }
  bool stops_by_silence(std::uint64_t now_ns) {
    if (!owner_.lost(now_ns)) return false;
    seen_false_ = false;  // whoever comes next begins with false
    return std::exchange(enabled_, false);
  }
  [[nodiscard]] double watched_for_s(std::uint64_t now_ns) const { return enabled_ ? owner_.left_s(now_ns) : 0.0; }

 private:
  static constexpr double kRearms_per_s = 2.0;
  /// His true comes too early: the next one counts as the step.
  Verdict refuse() {
    enabled_ = false;
    return Verdict::kRefused;
  }
  Owner owner_;
  Pace rearms_{kRearms_per_s};
  bool enabled_ = false, seen_false_ = false;
};

/// `adjust/…`, std_msgs/Float64: the owner's number, clamped. His silence gives the number of the session file.
class AdjustRule {
 public:
  AdjustRule(double least, double most, double timeout_s) : least_(least), most_(most), owner_(timeout_s) {}
  Verdict hears(double value, Author author, std::uint64_t now_ns) {
    if (!std::isfinite(value) || !owner_.hears(author, now_ns)) return Verdict::kRefused;
    wanted_ = std::clamp(value, least_, most_);
    return Verdict::kOrder;
  }
  /// What the owner wants; none: the session file's.
  [[nodiscard]] std::optional<double> wanted() const { return wanted_; }
  void end_by_silence(std::uint64_t now_ns) {
    if (owner_.lost(now_ns)) wanted_.reset();
  }

 private:
  double least_, most_;
  Owner owner_;
  std::optional<double> wanted_;
};

/// `<haptic>/clutch`, std_msgs/Bool, and `<haptic>/extra_wrench`, geometry_msgs/WrenchStamped: the owner's newest
/// value, for as long as he repeats it.
template <class Value>
class HeldRule {
 public:
  explicit HeldRule(double timeout_s) : owner_(timeout_s) {}
  Verdict hears(const Value& value, Author author, std::uint64_t now_ns) {
    if (!owner_.hears(author, now_ns)) return Verdict::kRefused;
    value_ = value;
    fresh_ = true;
    return Verdict::kOrder;
  }
  /// The newest value, once; none: nothing has come.
  std::optional<Value> take() { return std::exchange(fresh_, false) ? std::optional(value_) : std::nullopt; }
  /// How long it may be held without another message.
  [[nodiscard]] double holds_for_s(std::uint64_t now_ns) const { return owner_.left_s(now_ns); }
  void end_by_silence(std::uint64_t now_ns) { (void)owner_.lost(now_ns); }

 private:
  Owner owner_;
  Value value_{};
  bool fresh_ = false;
};

/// `mark`, std_msgs/String: the owner's texts, so many a second.
class MarkRule {
 public:
  explicit MarkRule(double per_s) : owner_(kTimeout_s), pace_(per_s) {}
  Verdict hears(Author author, std::uint64_t now_ns) {
    (void)owner_.lost(now_ns);  // nothing hangs on his silence
    return owner_.hears(author, now_ns) && pace_.allows(now_ns) ? Verdict::kOrder : Verdict::kRefused;
  }

 private:
  static constexpr double kTimeout_s = 1.0;
  Owner owner_;
  Pace pace_;
};

/// Printable, at most `most` bytes, for an order. Bytes that are no ASCII become '?'.
[[nodiscard]] inline std::string printable(const char* text, std::size_t most = 200) {
  std::string out;
  for (; text != nullptr && *text != '\0' && out.size() < most; ++text) {
    out += (*text >= 0x20 && *text < 0x7f) ? *text : '?';
  }
  return out;
}

}  // namespace bridge
