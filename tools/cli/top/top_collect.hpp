#pragma once
/// @file top_collect.hpp
/// Gathers what `rtbus top` shows, again and again, while nodes come and go. Reads only, never waits for a writer and
/// never rings it. Following the telemetry makes each haptic loop publish it: one copy of 240 bytes per tick.
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "rtbus/topic.hpp"
#include "rtbus/topic_directory.hpp"
#include "tools/cli/top/top_signal.hpp"
#include "tools/cli/top/top_state.hpp"

namespace tools {

/// A reader that opens its topic when it appears, and anew when it is replaced.
template <rtbus::Sample T>
class Follow {
 public:
  /// @param presence Lets the writer know that somebody looks.
  Follow(rtbus::Session session, std::string topic, bool presence = false)
      : session_(std::move(session)), topic_(std::move(topic)), presence_(presence) {}

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
  [[nodiscard]] std::uint64_t missed() const { return reader_ ? reader_->missed() : 0; }

 private:
  void attach() {
    if (reader_ && !reader_->replaced()) return;
    auto opened = rtbus::Reader<T>::open(
        session_, topic_, {.presence = presence_, .from_oldest = true, .trust = rtbus::OwnerTrust::kAnyone});
    if (opened) reader_.emplace(std::move(*opened));
  }

  rtbus::Session session_;
  std::string topic_;
  bool presence_;
  std::optional<rtbus::Reader<T>> reader_;
  std::optional<rtbus::Stamped<T>> newest_;
  std::uint64_t visited_until_ns_ = 0;
};

/// One per screen; one thread.
class TopCollector {
 public:
  /// @param session None: the only live one, chosen anew when it ends.
  /// @param telemetry Follow the haptic nodes' telemetry, which they publish only while somebody does.
  TopCollector(std::optional<std::string> session, bool telemetry)
      : wanted_(std::move(session)), telemetry_(telemetry) {}

  /// Looks at everything: every topic is opened once, some hundred microseconds.
  [[nodiscard]] TopSnapshot collect();

  /// Takes in the telemetry alone: often enough that its ring (two seconds) never overtakes.
  void follow();

  /// From now on this session, as if it had been named at the start.
  void choose(const std::string& session) { wanted_ = session; }

  /// The newest sample of one topic of the session, which is then held open, noticed by its writer, until another one
  /// is asked for or leave_sample().
  [[nodiscard]] SampleView sample(const std::string& topic);
  void leave_sample() { sample_reader_.reset(); }

 private:
  struct Node;
  void follow_session(const std::string& session);
  void find_nodes(const std::vector<rtbus::TopicInfo>& topics);
  void add_nodes(TopSnapshot& snapshot, const std::vector<rtbus::TopicInfo>& topics);
  void add_topics(TopSnapshot& snapshot, const std::vector<rtbus::TopicInfo>& topics);

  struct Count {
    std::uint64_t published = 0;
    std::uint64_t at_ns = 0;
    std::optional<double> rate_hz;
  };
  std::optional<std::string> wanted_;
  bool telemetry_;
  std::string session_;
  std::map<std::string, std::shared_ptr<Node>> nodes_;  ///< By name.
  std::map<std::string, Count> counts_;                 ///< Topics, for their rates.
  std::string sample_topic_;
  std::optional<rtbus::RawReader> sample_reader_;
};

}  // namespace tools
