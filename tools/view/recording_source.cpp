#include "tools/view/recording_source.hpp"

#include <algorithm>
#include <cmath>
#include <exception>
#include <optional>
#include <string_view>
#include <utility>

#include "rtbus/clock.hpp"
#include "rtbus/shape_messages.hpp"
#include "tools/view/session_scene.hpp"
#include "tools/view/stored_session.hpp"

namespace view {

namespace {

using Json = nlohmann::ordered_json;

constexpr std::string_view kTelemetry = ".telemetry";

}  // namespace

RecordingSource::RecordingSource(rtbus::recording::Recording recording) : recording_(std::move(recording)) {}

rtbus::Result<std::shared_ptr<RecordingSource>, std::string> RecordingSource::open(const std::string& file) {
  auto recording = rtbus::recording::Recording::open(file);
  if (!recording) return rtbus::Failure{recording.error().message};
  std::shared_ptr<RecordingSource> source(new RecordingSource(std::move(*recording)));
  if (std::string trouble = source->load(); !trouble.empty()) return rtbus::Failure{file + ": " + trouble};
  return source;
}

void RecordingSource::read_told_shapes() {
  RecordedTrack<rtbus::BodyShapes> track(recording_, "physics.body_shapes", notes_);
  rtbus::Stamped<rtbus::BodyShapes> part;
  for (std::size_t row = 0; row < track.rows(); ++row) {
    if (track.read(row, part)) (void)told_.take(part.value);
  }
}

std::string RecordingSource::load() {
  read_told_shapes();
  SessionScene made;
  try {
    with_stored_session(recording_, [&](rtbus::config::SessionConfig& session) {
      if (told_.told()) session.scene.bodies = told_.told()->shown;
      made = scene_of(session);
    });
  } catch (const std::exception& error) {
    notes_.push_back(std::string("the scene of this recording cannot be shown: ") + error.what());
    made.scene.document = {{"shapes", Json::array()},
                           {"bodies", Json::array()},
                           {"soft", Json::array()},
                           {"meshes", 0},
                           {"hands", Json::array()}};
    for (const auto& topic : recording_.topics()) {  // hands without what the session says of them
      if (!topic.name.ends_with(kTelemetry)) continue;
      SessionHand hand;
      hand.config.name = topic.name.substr(0, topic.name.size() - kTelemetry.size());
      made.scene.document["hands"].push_back({{"name", hand.config.name},
                                              {"device", ""},
                                              {"method", ""},
                                              {"rate_hz", 1000.0},
                                              {"radius_m", 0.0},
                                              {"force_limit_n", 1.0},
                                              {"q_WD", {1.0, 0.0, 0.0, 0.0}},
                                              {"position_scale", 1.0},
                                              {"workspace_min_m", {0.0, 0.0, 0.0}},
                                              {"workspace_max_m", {0.0, 0.0, 0.0}}});
      made.hands.push_back(std::move(hand));
    }
  }
  bodies_ = std::make_unique<RecordedBodies>(recording_, notes_);
  for (SessionHand& hand : made.hands) {
    hands_.emplace_back(recording_, std::move(hand), notes_);
  }
  if (!recording_.complete()) {
    notes_.emplace_back("the recording was cut short (its recorder was killed), or it still grows: it ends here");
  }
  if (made.moving && !bodies_->any_poses()) {
    notes_.emplace_back("bodies were not recorded: they stand where the scene places them");
  }
  if (std::string trouble = find_span(); !trouble.empty()) return trouble;
  scene_ = std::move(made.scene);
  scene_.number = 1;
  Json& document = scene_.document;
  document["type"] = "scene";
  document["number"] = 1;
  document["session"] = recording_.session();
  document["name"] = recording_.session();
  document["file"] = recording_.path();
  Json notes = document.value("notes", Json::array());
  for (const std::string& note : notes_) notes.push_back(note);
  document["notes"] = std::move(notes);
  frame_.hands.resize(hands_.size());
  figures_.set({{"type", "figures"}, {"haptic", Json::array()}, {"physics", Json::array()}});
  for (const auto& mark : recording_.marks()) {
    marks_.push_back(
        {{"at_s", (static_cast<double>(mark.stamp_ns) - static_cast<double>(begin_ns_)) * 1e-9}, {"text", mark.text}});
  }
  tell_playback();
  return "";
}

std::string RecordingSource::find_span() {
  std::uint64_t first_ns = UINT64_MAX, last_ns = 0;
  const auto take = [&](const auto& track) {
    if (track.rows() == 0) return;
    first_ns = std::min(first_ns, track.stamp_ns(0));
    last_ns = std::max(last_ns, track.stamp_ns(track.rows() - 1));
  };
  for (const RecordedHand& hand : hands_) {
    take(hand.ticks());
    take(hand.devices());
  }
  if (last_ns == 0 || first_ns == UINT64_MAX) {
    return "no hand was recorded: there is nothing to show (`rtbus export` lists what it holds)";
  }
  begin_ns_ = first_ns;
  playback_ = Playback(static_cast<double>(last_ns - first_ns) * 1e-9);
  return "";
}

std::uint64_t RecordingSource::time_ns() const {
  return begin_ns_ + static_cast<std::uint64_t>(std::llround(playback_.at_s() * 1e9));
}

void RecordingSource::step(int ticks) {
  if (ticks == 0 || hands_.empty() || hands_.front().ticks().rows() == 0) return;
  const auto& track = hands_.front().ticks();
  const auto here = static_cast<std::ptrdiff_t>(track.until(time_ns())) - 1;
  const auto there = std::clamp<std::ptrdiff_t>(here + ticks, 0, static_cast<std::ptrdiff_t>(track.rows()) - 1);
  const std::uint64_t stamp_ns = track.stamp_ns(static_cast<std::size_t>(there));
  playback_.go_to(static_cast<double>(stamp_ns - begin_ns_) * 1e-9, ticks < 0);
}

void RecordingSource::follow() {
  playback_.advance(rtbus::monotonic_ns());
  step(playback_.take_steps());
  const bool jump = !began_ || playback_.jumps() != jumps_;
  if (jump || playback_.at_s() != shown_s_) {
    began_ = true;
    jumps_ = playback_.jumps();
    shown_s_ = playback_.at_s();
    const std::uint64_t time = time_ns();
    frame_.contacts.clear();
    for (std::size_t i = 0; i < hands_.size(); ++i) {
      hands_[i].follow(time, jump, kHistory_s, frame_.hands[i]);
      hands_[i].add_contacts(time, static_cast<std::uint32_t>(i), frame_.hands[i], frame_.contacts);
    }
    const bool poses = bodies_->poses_at(time, frame_.poses, frame_.simulated_s);
    if (poses && told_.told() && frame_.poses.size() == told_.told()->bodies) {
      frame_.poses = told_.told()->placed(frame_.poses);
    }
    const bool nodes = bodies_->nodes_at(time, frame_.soft_nodes_m);
    if (poses || nodes) {
      ++frame_.poses_number;
      frame_.poses_s = static_cast<double>(time) * 1e-9;
    }
    frame_.jumps = jumps_;
    ++frame_.number;
  }
  judge_hands();
  tell_playback();
}

void RecordingSource::judge_hands() {
  Json state = {{"type", "state"}, {"session", recording_.session()}, {"word", "NO DATA"}, {"level", "warn"}};
  state["reason"] = "no hand was recorded";
  state["problem"] = nullptr;
  state["hands"] = Json::array();
  std::optional<HandState> worst;
  for (RecordedHand& hand : hands_) {
    const HandState each = hand.state(time_ns());
    state["hands"].push_back(
        {{"name", hand.name()}, {"word", each.word}, {"level", to_string(each.level)}, {"reason", each.reason}});
    if (!worst || each.level > worst->level) worst = each;
  }
  if (worst) {
    state["word"] = worst->word;
    state["level"] = to_string(worst->level);
    state["reason"] = worst->reason;
  }
  state_.set(std::move(state));
}

void RecordingSource::tell_playback() {
  Json out = {{"type", "playback"},
              {"file", recording_.path()},
              {"started_utc", recording_.started_utc()},
              {"length_s", playback_.length_s()},
              {"begin_s", static_cast<double>(begin_ns_) * 1e-9},
              {"playing", playback_.playing()},
              {"speed", playback_.speed()}};
  out["marks"] = marks_;
  playback_state_.set(std::move(out));
}

}  // namespace view
