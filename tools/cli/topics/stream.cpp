// `rtbus stream --plotjuggler udp://HOST:PORT`: the samples of a session as JSON datagrams.
#include <netdb.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <iostream>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "rtbus/clock.hpp"
#include "rtbus/topic_directory.hpp"
#include "tools/cli/common/choose.hpp"
#include "tools/cli/common/command.hpp"
#include "tools/cli/common/field_format.hpp"
#include "tools/cli/common/interrupt.hpp"
#include "tools/cli/host/loop_cores.hpp"

namespace tools {
namespace {

struct StreamOptions {
  std::string address;
  std::optional<std::string> session;
  std::vector<std::string> topics;
  std::optional<double> duration_s;
  double rate_hz = 250.0;
};

struct Followed {
  rtbus::RawReader reader;
  std::uint64_t sent_ns = 0;  ///< Stamp of the last sample that was sent.
};

int refuse(const std::string& message, int status) {
  std::cerr << "rtbus stream: " << message << '\n';
  return status;
}

/// "udp://host:port" in its parts; nullopt when it is something else.
std::optional<std::pair<std::string, std::string>> split(const std::string& address) {
  constexpr std::string_view kScheme = "udp://";
  if (!address.starts_with(kScheme)) return std::nullopt;
  const std::string rest = address.substr(kScheme.size());
  const std::size_t colon = rest.rfind(':');
  if (colon == rest.npos || colon == 0 || colon + 1 == rest.size()) return std::nullopt;
  return std::pair{rest.substr(0, colon), rest.substr(colon + 1)};
}

/// A socket that is connected to there, or −1.
int open_socket(const std::pair<std::string, std::string>& there, std::string& error) {
  addrinfo hints{};
  hints.ai_socktype = SOCK_DGRAM;
  addrinfo* found = nullptr;
  if (const int code = ::getaddrinfo(there.first.c_str(), there.second.c_str(), &hints, &found); code != 0) {
    error = ::gai_strerror(code);
    return -1;
  }
  int out = -1;
  for (const addrinfo* each = found; each != nullptr && out < 0; each = each->ai_next) {
    out = ::socket(each->ai_family, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (out >= 0 && ::connect(out, each->ai_addr, each->ai_addrlen) != 0) ::close(std::exchange(out, -1));
  }
  ::freeaddrinfo(found);
  if (out < 0) error = "no way there";
  return out;
}

/// One datagram: {"timestamp": seconds, "haptic0": {"telemetry": {…}}}. PlotJuggler makes the path of each number its
/// name, and takes the time from the field `timestamp` when told so.
std::string datagram(const std::string& topic, const rtbus::RawReader& reader) {
  nlohmann::ordered_json fields =
      json_sample({reader.sequence(), reader.stamp_ns(), reader.bytes()}, reader.description().fields);
  fields.erase("stamp_ns");
  for (auto part = topic; !part.empty();) {
    const std::size_t dot = part.rfind('.');
    nlohmann::ordered_json outer;
    outer[part.substr(dot == part.npos ? 0 : dot + 1)] = std::move(fields);
    fields = std::move(outer);
    part.resize(dot == part.npos ? 0 : dot);
  }
  nlohmann::ordered_json whole = {{"timestamp", 1e-9 * static_cast<double>(reader.stamp_ns())}};
  whole.update(fields);
  return json_line(whole);
}

int stream(const StreamOptions& options) {
  const auto there = split(options.address);
  if (!there) return refuse("\"" + options.address + "\" is no address; write udp://127.0.0.1:9870", kExitUsage);
  const auto session = choose_session(rtbus::list_topics(), options.session);
  if (!session) return refuse(session.error().message, session.error().exit_status);
  std::string error;
  const int out = open_socket(*there, error);
  if (out < 0) return refuse(options.address + ": " + error, kExitFailed);

  rtbus::Session where;
  where.name = *session;
  std::map<std::string, Followed> topics;
  const auto wanted = [&](const std::string& topic) {
    return std::any_of(options.topics.begin(), options.topics.end(),
                       [&](const std::string& name) { return topic.find(name) != std::string::npos; });
  };
  const auto attach = [&] {
    const std::vector<rtbus::TopicInfo> there_now = rtbus::list_topics(*session);
    keep_off_loops(there_now);
    for (const rtbus::TopicInfo& info : there_now) {
      if (!info.problem.empty() || !info.writer_alive || !wanted(info.topic)) continue;
      const auto known = topics.find(info.topic);
      if (known != topics.end() && !known->second.reader.replaced()) continue;
      auto reader = rtbus::RawReader::open(where, info.topic, {.presence = true, .trust = rtbus::OwnerTrust::kAnyone});
      if (!reader) continue;
      topics.erase(info.topic);
      topics.emplace(info.topic, Followed{std::move(*reader)});
    }
  };
  attach();
  if (topics.empty()) {
    ::close(out);
    return refuse("no topic of the session " + *session + " is called so; `rtbus list` shows them", kExitUsage);
  }
  const auto spacing_ns = static_cast<std::uint64_t>(1e9 / options.rate_hz);
  const std::uint64_t begin_ns = rtbus::monotonic_ns();
  std::uint64_t look_ns = begin_ns + rtbus::kNsPerS, sent = 0, refused = 0;
  std::printf("streaming %zu topics of %s to %s (Ctrl-C ends)\n", topics.size(), session->c_str(),
              options.address.c_str());
  std::fflush(stdout);
  while (!interrupted()) {
    const std::uint64_t now_ns = rtbus::monotonic_ns();
    if (options.duration_s && rtbus::seconds_between(begin_ns, now_ns) >= *options.duration_s) break;
    if (now_ns >= look_ns) {
      attach();
      look_ns = now_ns + rtbus::kNsPerS;
    }
    for (auto& [name, topic] : topics) {
      for (std::uint32_t i = 0; i < topic.reader.description().capacity; ++i) {
        if (topic.reader.read_next() != rtbus::ReadStatus::kFresh) break;
        // Every n-th: a viewer needs a picture, not each tick. A little early counts as on time.
        if (topic.sent_ns != 0 && topic.reader.stamp_ns() - topic.sent_ns < spacing_ns - spacing_ns / 8) continue;
        topic.sent_ns = topic.reader.stamp_ns();
        const std::string text = datagram(name, topic.reader);
        // Nobody listening yet is no error: the viewer may be started later.
        if (::send(out, text.data(), text.size(), 0) == static_cast<ssize_t>(text.size())) {
          ++sent;
        } else {
          ++refused;
        }
      }
    }
    sleep_unless_interrupted(5 * rtbus::kNsPerMs);
  }
  ::close(out);
  std::printf("%llu samples sent, %llu not taken\n", static_cast<unsigned long long>(sent),
              static_cast<unsigned long long>(refused));
  return kExitFine;
}

}  // namespace

Action add_stream(rtbus::Command command) {
  auto options = std::make_shared<StreamOptions>();
  options->topics = {"telemetry", "proxy_state", "loop_stats", "step_stats"};
  command.option("--plotjuggler", options->address, "Where to: udp://127.0.0.1:9870 is PlotJuggler's own default")
      .required();
  command.option("-s,--session", options->session, "Session; not needed while only one is live").type_name("SESSION");
  command.option("-t,--topics", options->topics, "Topics whose names contain this (several allowed)").show_default();
  command.option("-r,--rate", options->rate_hz, "At most so many samples per second of each topic")
      .range(1.0, 20000.0)
      .show_default();
  command.option("-d,--duration", options->duration_s, "End after so many seconds (without it: Ctrl-C)").positive();
  command.footer(
      "In PlotJuggler: Streaming, \"UDP Server\", port 9870, protocol JSON, \"use field as timestamp\": timestamp.");
  return [options] { return stream(*options); };
}

}  // namespace tools
