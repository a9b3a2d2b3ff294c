#include "tools/cli/top/top_collect.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "rtbus/clock.hpp"
#include "rtbus/order_messages.hpp"
#include "tools/cli/common/choose.hpp"
#include "tools/cli/host/loop_cores.hpp"
#include "tools/cli/top/top_view.hpp"
#include "tools/cli/topics/topic_rate.hpp"

namespace tools {

namespace {

/// Statistics come 5 times a second: the force "now" goes over the last three.
constexpr std::uint64_t kForceWindow_ns = 500 * rtbus::kNsPerMs;
/// Rates of topics are differences over at least this long, so that 5 Hz topics do not flicker.
constexpr std::uint64_t kRateWindow_ns = 2 * rtbus::kNsPerS;

/// "haptic0.loop_stats" → "haptic0" when the subject is one by which a node is known.
std::optional<std::string> node_of(const std::string& topic) {
  constexpr std::array<std::string_view, 2> kSubjects = {".heartbeat", ".node_info"};
  for (const std::string_view subject : kSubjects) {
    if (topic.ends_with(subject)) return topic.substr(0, topic.size() - subject.size());
  }
  return std::nullopt;
}

template <class T>
std::optional<T> value_of(const std::optional<rtbus::Stamped<T>>& sample) {
  return sample ? std::optional<T>(sample->value) : std::nullopt;
}

}  // namespace

struct TopCollector::Node {
  Node(const rtbus::Session& session, const std::string& name, bool follow_telemetry)
      : heartbeat(session, name + ".heartbeat"),
        info(session, name + ".node_info"),
        loop_stats(session, name + ".loop_stats"),
        device_state(session, name + ".device_state"),
        link_stats(session, name + ".link_stats"),
        orders(session, name + ".orders"),
        step_stats(session, name + ".step_stats") {
    if (follow_telemetry) telemetry.emplace(session, name + ".telemetry", true);
  }

  void take_telemetry() {
    if (telemetry) telemetry->drain([this](const auto& tick) { signals.take(tick.value, tick.stamp_ns); });
  }

  Follow<rtbus::Heartbeat> heartbeat;
  Follow<rtbus::NodeInfo> info;
  Follow<rtbus::LoopStats> loop_stats;
  Follow<rtbus::DeviceState> device_state;
  Follow<rtbus::LinkStats> link_stats;  ///< Never comes where there is no link.
  Follow<rtbus::Orders> orders;         ///< Likewise without `rtbus run`.
  Follow<rtbus::StepStats> step_stats;
  std::optional<Follow<rtbus::Telemetry>> telemetry;
  RecentSignals signals;
  std::vector<rtbus::Stamped<rtbus::LoopStats>> recent;  ///< Loop statistics of the force window, oldest first.
};

void TopCollector::follow_session(const std::string& session) {
  if (session == session_) return;
  session_ = session;
  nodes_.clear();
  counts_.clear();
  sample_reader_.reset();
}

void TopCollector::find_nodes(const std::vector<rtbus::TopicInfo>& topics) {
  std::map<std::string, std::shared_ptr<Node>> found;
  rtbus::Session session;
  session.name = session_;
  for (const rtbus::TopicInfo& info : topics) {
    const std::optional<std::string> name = node_of(info.topic);
    if (!name || found.contains(*name)) continue;
    const auto known = nodes_.find(*name);
    found[*name] = known != nodes_.end() ? known->second : std::make_shared<Node>(session, *name, telemetry_);
  }
  nodes_ = std::move(found);  // a node whose topics are gone has ended cleanly
}

void TopCollector::add_nodes(TopSnapshot& snapshot, const std::vector<rtbus::TopicInfo>& topics) {
  for (auto& entry : nodes_) {
    const std::string& name = entry.first;  // by name: Clang 14 lets no lambda capture a structured binding
    auto& node = entry.second;
    NodeLife life;
    const auto& beat = node->heartbeat.newest();
    const std::uint64_t now_ns = rtbus::monotonic_ns();
    life.writer_alive = node->heartbeat.writer_alive();
    if (beat) {
      life.heartbeat_age_s = std::max(0.0, rtbus::seconds_between(beat->stamp_ns, now_ns));
      life.pid = beat->value.pid;
    }
    const auto own =
        std::find_if(topics.begin(), topics.end(), [&](const auto& t) { return t.topic == name + ".heartbeat"; });
    if (own != topics.end() && own->epoch > 0) {
      life.restarts = own->epoch - 1;
      life.process_age_s = std::max(0.0, rtbus::seconds_between(own->writer_start_ns, now_ns));
    }
    const std::optional<rtbus::NodeInfo> info = value_of(node->info.newest());
    node->loop_stats.drain([&](const auto& sample) { node->recent.push_back(sample); });
    // A restarted node counts from zero again: what was before says nothing about it.
    const auto restart = std::adjacent_find(node->recent.rbegin(), node->recent.rend(),
                                            [](const auto& a, const auto& b) { return a.value.ticks < b.value.ticks; });
    if (restart != node->recent.rend()) node->recent.erase(node->recent.begin(), (restart + 1).base());
    const bool haptic = info ? rtbus::text_of(info->role) == "haptic" : !node->recent.empty();
    if (!haptic) {
      snapshot.physics.push_back({name, life, info, value_of(node->step_stats.newest())});
      continue;
    }
    HapticView view;
    view.name = name;
    view.life = life;
    view.info = info;
    view.device = value_of(node->device_state.newest());
    view.link = value_of(node->link_stats.newest());
    if (const auto& order = node->orders.newest(); order && order->value.estop != 0) {
      view.estop = rtbus::text_of(order->value.reason);
    }
    node->take_telemetry();
    // Its own clock: what came while it was read is not from the future.
    if (node->telemetry) view.recent = node->signals.view(rtbus::monotonic_ns(), node->telemetry->missed());
    auto& recent = node->recent;
    while (recent.size() > 2 && recent.back().stamp_ns - recent.front().stamp_ns > kForceWindow_ns)
      recent.erase(recent.begin());
    if (!recent.empty()) {
      view.stats = recent.back().value;
      view.force_n = force_between(recent.front().value, recent.back().value);
      if (view.stats->last_loss_ns != 0) view.loss_age_s = rtbus::seconds_between(view.stats->last_loss_ns, now_ns);
    }
    snapshot.haptic.push_back(std::move(view));
  }
}

void TopCollector::add_topics(TopSnapshot& snapshot, const std::vector<rtbus::TopicInfo>& topics) {
  for (const rtbus::TopicInfo& info : topics) {
    const std::uint64_t now_ns = rtbus::monotonic_ns();
    const auto [entry, first] = counts_.try_emplace(info.topic);
    Count& count = entry->second;
    if (first || info.published < count.published) {
      count = {info.published, now_ns,
               info.problem.empty() ? recent_rate(info.session, info.topic).rate_hz : std::nullopt};
    } else if (now_ns - count.at_ns >= kRateWindow_ns) {
      const double elapsed_s = rtbus::seconds_between(count.at_ns, now_ns);
      count = {info.published, now_ns, static_cast<double>(info.published - count.published) / elapsed_s};
    }
    snapshot.topics.push_back(
        {info.topic, count.rate_hz, info.published, info.writer_pid, info.writer_alive, info.problem});
  }
}

void TopCollector::follow() {
  for (auto& [name, node] : nodes_) node->take_telemetry();
}

SampleView TopCollector::sample(const std::string& topic) {
  SampleView view;
  view.topic = topic;
  if (!sample_reader_ || sample_topic_ != topic || sample_reader_->replaced()) {
    sample_topic_ = topic;
    rtbus::Session session;
    session.name = session_;
    auto opened = rtbus::RawReader::open(session, topic, {.presence = true, .trust = rtbus::OwnerTrust::kAnyone});
    if (opened) {
      sample_reader_.emplace(std::move(*opened));
    } else {
      sample_reader_.reset();
      view.problem = rtbus::to_string(opened.error());
      return view;
    }
  }
  rtbus::RawReader& reader = *sample_reader_;
  (void)reader.read_latest();  // nothing new: the last one stays
  view.type_name = reader.description().type_name;
  if (reader.sequence() == 0) {
    view.problem = "no sample yet";
    return view;
  }
  view.sequence = reader.sequence();
  view.age_s = std::max(0.0, rtbus::seconds_between(reader.stamp_ns(), rtbus::monotonic_ns()));
  for (const auto& field : reader.description().fields) {
    FieldView shown{field.name, field.unit, {}};
    for (std::uint32_t i = 0; i < rtbus::field_elements(field); ++i)
      shown.values.push_back(rtbus::field_value(reader.bytes(), field, i));
    view.fields.push_back(std::move(shown));
  }
  return view;
}

TopSnapshot TopCollector::collect() {
  TopSnapshot snapshot;
  std::vector<rtbus::TopicInfo> topics = rtbus::list_topics();
  snapshot.sessions = sessions_in(topics, true);
  auto chosen = choose_session(topics, wanted_);
  if (!chosen && snapshot.sessions.empty()) {
    // All processes of the session on the screen have died: show what they left, until another session comes alive.
    const std::vector<std::string> left = sessions_in(topics, false);
    if (std::find(left.begin(), left.end(), session_) != left.end()) chosen = session_;
  }
  if (!chosen) {
    snapshot.message = chosen.error().message;
    follow_session("");
    return snapshot;
  }
  follow_session(*chosen);
  snapshot.session = *chosen;
  std::erase_if(topics, [&](const rtbus::TopicInfo& info) { return info.session != session_; });
  const std::uint64_t now_ns = rtbus::monotonic_ns();
  for (const rtbus::TopicInfo& info : topics) {
    if (info.writer_alive) {
      snapshot.uptime_s = std::max(snapshot.uptime_s, rtbus::seconds_between(info.writer_start_ns, now_ns));
    }
  }
  keep_off_loops(topics);
  find_nodes(topics);
  add_nodes(snapshot, topics);
  add_topics(snapshot, topics);
  return snapshot;
}

}  // namespace tools
