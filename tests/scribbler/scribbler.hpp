#pragma once
/// @file scribbler.hpp
/// A thread that damages the segments of a session, as somebody with the right to write could: anything, anywhere, at
/// any time. It follows topics that are made anew.
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <functional>
#include <limits>
#include <map>
#include <random>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "rtbus/clock.hpp"
#include "rtbus/detail/file.hpp"
#include "rtbus/detail/layout.hpp"
#include "rtbus/segment.hpp"
#include "rtbus/topic_directory.hpp"

namespace tests {

class Scribbler {
 public:
  /// @param chooses Whether a topic, by its name, is to be damaged.
  Scribbler(std::string session, std::function<bool(const std::string&)> chooses, std::uint64_t seed)
      : session_(std::move(session)), chooses_(std::move(chooses)), random_(seed), thread_([this] { run(); }) {}
  ~Scribbler() { stop(); }
  Scribbler(const Scribbler&) = delete;
  Scribbler& operator=(const Scribbler&) = delete;

  void stop() {
    stop_.store(true);
    if (thread_.joinable()) thread_.join();
  }
  /// Writes into segments that had their name and a live writer before and after.
  [[nodiscard]] std::uint64_t live_writes() const { return live_writes_.load(); }
  /// Their mean rate [1/s].
  [[nodiscard]] double live_writes_per_s() const {
    return static_cast<double>(live_writes_.load()) / rtbus::seconds_between(began_ns_, ended_ns_.load());
  }
  /// Inodes that were written: more than topics once some were made anew.
  [[nodiscard]] std::size_t segments() const { return inodes_; }

 private:
  static constexpr std::size_t kBurst = 200;  ///< Writes between two pauses, shared by the segments …
  static constexpr std::size_t kLeast = 20;   ///< … at least so many for each.
  static constexpr std::uint64_t kPause_ns = rtbus::kNsPerMs;
  static constexpr std::uint64_t kLookEvery_ns = 10 * rtbus::kNsPerMs;

  struct Target {
    std::string path;
    rtbus::detail::Geometry where{};
    std::uint32_t capacity = 0, sample_bytes = 0;
    std::size_t header_bytes = 0;
    std::vector<std::uint32_t> counts;  ///< Offsets of the fields of 32 bits.
    int fd = -1;
    ino_t inode = 0;
  };

  void run() {
    std::uint64_t look_ns = 0;
    while (!stop_.load()) {
      if (rtbus::monotonic_ns() >= look_ns) {
        look();
        look_ns = rtbus::monotonic_ns() + kLookEvery_ns;
      }
      const std::size_t each = std::max(kLeast, kBurst / std::max<std::size_t>(1, targets_.size()));
      for (auto& [topic, target] : targets_) {
        if (!follow(target)) continue;
        for (std::size_t i = 0; i < each; ++i) damage(target);
        if (alive(target)) live_writes_.fetch_add(each);
      }
      ended_ns_.store(rtbus::monotonic_ns());
      rtbus::sleep_until(rtbus::monotonic_ns() + kPause_ns);
    }
    for (auto& [topic, target] : targets_) ::close(target.fd);
  }

  /// Topics that came since. Their layout is learnt while their header is whole, and kept.
  void look() {
    for (const rtbus::TopicInfo& info : rtbus::list_topics(session_)) {
      if (!info.problem.empty() || targets_.contains(info.topic) || !chooses_(info.topic)) continue;
      Target target;
      target.path = "/dev/shm/" + rtbus::segment_name(info.session, info.topic);
      const auto fields = static_cast<std::uint32_t>(info.fields.size());
      target.where = rtbus::detail::geometry(info.sample_bytes, info.capacity, fields, false);
      target.capacity = info.capacity;
      target.sample_bytes = info.sample_bytes;
      target.header_bytes = rtbus::detail::header_end(fields);
      for (const auto& field : info.fields) {
        if (field.type == rtbus::FieldType::kU32) target.counts.push_back(field.offset);
      }
      targets_.emplace(info.topic, std::move(target));
    }
  }

  [[nodiscard]] static bool alive(const Target& target) {
    struct stat status {};
    return ::lstat(target.path.c_str(), &status) == 0 && status.st_ino == target.inode &&
           rtbus::detail::is_locked_against(target.fd, F_RDLCK, rtbus::detail::kWriterLockByte);
  }

  /// Opens the name again when it leads elsewhere.
  bool follow(Target& target) {
    if (target.fd >= 0 && alive(target)) return true;
    if (target.fd >= 0) ::close(std::exchange(target.fd, -1));
    target.fd = ::open(target.path.c_str(), O_RDWR | O_CLOEXEC | O_NOFOLLOW);
    struct stat status {};
    // One that is not ready, or was cut, has another length: writing would make it grow.
    if (target.fd >= 0 &&
        (::fstat(target.fd, &status) != 0 || static_cast<std::uint64_t>(status.st_size) < target.where.segment_bytes)) {
      ::close(std::exchange(target.fd, -1));
    }
    if (target.fd < 0) return false;
    if (std::exchange(target.inode, status.st_ino) != status.st_ino) ++inodes_;
    return alive(target);
  }

  std::uint64_t any(std::uint64_t below) { return std::uniform_int_distribution<std::uint64_t>(0, below - 1)(random_); }
  static void put(const Target& target, std::size_t offset, const void* data, std::size_t bytes) {
    (void)!::pwrite(target.fd, data, bytes, static_cast<off_t>(offset));
  }
  static void put(const Target& target, std::size_t offset, std::uint64_t word) { put(target, offset, &word, 8); }
  static std::uint64_t get(const Target& target, std::size_t offset) {
    std::uint64_t word = 0;
    (void)!::pread(target.fd, &word, 8, static_cast<off_t>(offset));
    return word;
  }
  static std::size_t slot(const Target& target, std::uint64_t n) {
    return target.where.header_bytes + ((n - 1) & (target.capacity - 1)) * target.where.slot_stride;
  }
  /// One of the last three samples: what readers are about to read.
  std::size_t recent(const Target& target) { return slot(target, get(target, kNewest) + 1 - any(3)); }

  void damage(const Target& target) {
    const std::size_t words = target.sample_bytes / 8;
    const std::size_t payload_word = 16 + 8 * any(words);
    switch (any(12)) {
      case 0:  // anything anywhere
        return put(target, 8 * any(target.where.segment_bytes / 8), random_());
      case 1:  // anything in the samples that are read next
        return put(target, recent(target) + payload_word, random_());
      case 2:
        return put(target, recent(target) + payload_word, ~std::uint64_t{0});
      case 3: {  // a number that is none, or none that can be meant
        constexpr std::array kWild = {std::numeric_limits<double>::quiet_NaN(),
                                      std::numeric_limits<double>::infinity(),
                                      -std::numeric_limits<double>::infinity(),
                                      1e300,
                                      -1e18,
                                      1e9};
        const double value = kWild[any(kWild.size())];
        return put(target, recent(target) + payload_word, &value, sizeof value);
      }
      case 4: {
        const double value = std::numeric_limits<double>::denorm_min() * static_cast<double>(1 + any(1000));
        return put(target, recent(target) + payload_word, &value, sizeof value);
      }
      case 5: {  // a count without end
        if (target.counts.empty()) return;
        const std::uint32_t value = any(2) == 0 ? 0xffffffffu : static_cast<std::uint32_t>(any(1u << 20));
        return put(target, recent(target) + 16 + target.counts[any(target.counts.size())], &value, sizeof value);
      }
      case 6:  // an old sample, or one of the others, in the place of a new one
      case 7: {
        std::vector<std::byte> sample(8 + target.sample_bytes);
        const std::size_t from = slot(target, 1 + any(target.capacity));
        if (::pread(target.fd, sample.data(), sample.size(), static_cast<off_t>(from + 8)) <= 0) return;
        return put(target, recent(target) + 8, sample.data(), sample.size());
      }
      case 8:  // stamps, of the future and of the past
        return put(target, recent(target) + 8, any(2) == 0 ? random_() : rtbus::monotonic_ns() + any(rtbus::kNsPerS));
      case 9:  // the header, fields included
        return put(target, 8 * any(target.header_bytes / 8), any(2) == 0 ? random_() : ~std::uint64_t{0});
      case 10:  // the counter
        return put(target, kNewest, any(2) == 0 ? random_() : get(target, kNewest) + any(5) - 2);
      default: {  // a counter and a slot that fit each other
        const std::uint64_t n = std::uint64_t{1} << any(63);
        put(target, slot(target, n), 2 * n);
        return put(target, kNewest, n);
      }
    }
  }

  static constexpr std::size_t kNewest = offsetof(rtbus::detail::SegmentHeader, newest);
  std::string session_;
  std::function<bool(const std::string&)> chooses_;
  std::mt19937_64 random_;
  std::map<std::string, Target> targets_;
  std::size_t inodes_ = 0;
  std::uint64_t began_ns_ = rtbus::monotonic_ns();
  std::atomic<std::uint64_t> ended_ns_{began_ns_};
  std::atomic<std::uint64_t> live_writes_{0};
  std::atomic<bool> stop_{false};
  std::thread thread_;  ///< Last: it uses all of the above.
};

}  // namespace tests
