#pragma once
/// @file top_collect.hpp
/// Gathers what `rtbus top` shows, again and again, while nodes come and go. Reads only; the full-rate telemetry is
/// left alone, so that watching costs the loops nothing.
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "rtbus/topic.hpp"
#include "rtbus/topic_directory.hpp"
#include "tools/top_view.hpp"

namespace tools {

/// A reader that opens its topic when it appears, and anew when it is replaced.
template <rtbus::Sample T>
class Follow {
 public:
  Follow(rtbus::Session session, std::string topic) : session_(std::move(session)), topic_(std::move(topic)) {}

  /// The newest sample, or the last good one; none before the first.
  const std::optional<rtbus::Stamped<T>>& newest() {
    attach();
    rtbus::Stamped<T> sample;
    if (reader_ && reader_->read_latest(sample) == rtbus::ReadStatus::kFresh) newest_ = sample;
    return newest_;
  }

  /// Goes through everything since the last call in order, beginning with the oldest sample still held.
  template <class Visit>
  void drain(Visit&& visit) {
    attach();
    rtbus::Stamped<T> sample;
    while (reader_ && reader_->read_next(sample) == rtbus::ReadStatus::kFresh) {
      if (sample.stamp_ns <= visited_until_ns_) continue;  // a writer that makes its topic anew writes both for a while
      visited_until_ns_ = sample.stamp_ns;
      visit(sample);
    }
  }

  [[nodiscard]] bool writer_alive() const { return reader_ && reader_->writer_alive(); }

 private:
  void attach() {
    if (reader_ && !reader_->replaced()) return;
    auto opened = rtbus::Reader<T>::open(session_, topic_, {.from_oldest = true, .trust = rtbus::OwnerTrust::kAnyone});
    if (opened) reader_.emplace(std::move(*opened));
  }

  rtbus::Session session_;
  std::string topic_;
  std::optional<rtbus::Reader<T>> reader_;
  std::optional<rtbus::Stamped<T>> newest_;
  std::uint64_t visited_until_ns_ = 0;
};

/// One per screen; one thread.
class TopCollector {
 public:
  /// @param session None: the only live one, chosen anew when it ends.
  explicit TopCollector(std::optional<std::string> session) : wanted_(std::move(session)) {}

  [[nodiscard]] TopSnapshot collect();

 private:
  struct Node;
  void follow_session(const std::string& session);
  void find_nodes(const std::vector<rtbus::TopicInfo>& topics);
  void add_nodes(TopSnapshot& snapshot);
  void add_topics(TopSnapshot& snapshot, const std::vector<rtbus::TopicInfo>& topics);

  struct Count {
    std::uint64_t published = 0;
    std::uint64_t at_ns = 0;
    std::optional<double> rate_hz;
  };
  std::optional<std::string> wanted_;
  std::string session_;
  std::map<std::string, std::shared_ptr<Node>> nodes_;  ///< By name.
  std::map<std::string, Count> counts_;                 ///< Topics, for their rates.
};

}  // namespace tools
