#include "tools/view/live_source.hpp"

#include <algorithm>
#include <exception>
#include <utility>

#include "rtbus/clock.hpp"
#include "rtbus/config/session.hpp"
#include "tools/cli/top/top_json.hpp"
#include "tools/view/session_scene.hpp"

namespace view {

namespace {

using Json = nlohmann::ordered_json;

/// Sessions, nodes and figures are looked at this often.
constexpr std::uint64_t kLook_ns = 250 * rtbus::kNsPerMs;

double now_s() { return static_cast<double>(rtbus::monotonic_ns()) * 1e-9; }

/// Processes of the session that live.
std::set<std::uint32_t> pids_of(const tools::TopSnapshot& seen) {
  std::set<std::uint32_t> out;
  const auto add = [&](const tools::NodeLife& life) {
    if (life.writer_alive && life.pid != 0) out.insert(life.pid);
  };
  for (const tools::HapticView& node : seen.haptic) add(node.life);
  for (const tools::PhysicsView& node : seen.physics) add(node.life);
  return out;
}

}  // namespace

LiveSource::LiveSource(LiveOptions options) : options_(std::move(options)), collector_(options_.session, false) {
  look_around();
}

void LiveSource::look_around() {
  looked_ns_ = rtbus::monotonic_ns();
  seen_ = collector_.collect();
  Json figures = tools::top_json(seen_);
  figures["type"] = "figures";
  figures.erase("topics");
  figures_.set(std::move(figures));
  if (seen_.session.empty()) return;
  follow_told_shapes();

  std::set<std::uint32_t> pids = pids_of(seen_);
  if (pids.empty() || pids == pids_) return;
  std::optional<tools::StartedWith> started;
  if (!options_.config.empty()) started = tools::StartedWith{options_.config, options_.assignments};
  for (const std::uint32_t pid : pids) {
    if (!started) started = tools::started_with(pid);
  }
  pids_ = std::move(pids);
  started_ = started;
  if (started) {
    problem_ = load(*started);
  } else {
    problem_ =
        "cannot tell which file session " + seen_.session + " was started with; start the viewer with --config FILE";
  }
}

/// An engine that begins, or changes its world, tells other shapes than before.
void LiveSource::follow_told_shapes() {
  if (!told_ || told_->session() != seen_.session) told_.emplace(seen_.session);
  if (told_->follow() && started_) problem_ = load(*started_);
}

std::string LiveSource::load(const tools::StartedWith& started) {
  try {
    std::vector<rtbus::config::Override> overrides;
    for (const std::string& text : started.assignments) overrides.push_back(rtbus::config::parse_override(text));
    rtbus::config::SessionConfig session = rtbus::config::load_session(started.file, overrides);
    session.session.name = seen_.session;
    const bool told = told_ && told_->told();
    if (told) session.scene.bodies = told_->told()->shown;
    SessionScene made = scene_of(session);
    ViewScene& next = made.scene;
    if (scene_) next.document["number"] = scene_->number;
    if (scene_ && next.document == scene_->document) return "";  // the same again: a node was restarted
    moving_ = made.moving || told;
    yields_ = made.yields;
    std::vector<LiveHand> hands;
    for (SessionHand& hand : made.hands) hands.emplace_back(session.session, std::move(hand));
    show(std::move(next), session.session, std::move(hands));
    return "";
  } catch (const std::exception& error) {
    return error.what();
  }
}

void LiveSource::show(ViewScene scene, const rtbus::Session& session, std::vector<LiveHand> hands) {
  scene.number = ++scenes_;
  scene.document["number"] = scene.number;
  scene_ = std::move(scene);
  session_ = session;
  hands_ = std::move(hands);
  bodies_.reset();
  soft_.reset();
  const std::uint64_t number = frame_.number;
  frame_ = {};
  frame_.number = number + 1;
  frame_.hands.resize(hands_.size());
}

void LiveSource::follow_bodies() {
  if (moving_ && (!bodies_ || bodies_->replaced())) {
    bodies_.reset();
    if (auto opened = tools::BodyPoseReader::open(session_)) bodies_.emplace(std::move(*opened));
  }
  if (yields_ && (!soft_ || soft_->replaced())) {
    soft_.reset();
    if (auto opened = tools::SoftNodeReader::open(session_)) soft_.emplace(std::move(*opened));
  }
  bool fresh = false;
  if (bodies_ && bodies_->drain()) {
    const tools::ToldShapes* const told = told_ && told_->told() ? &*told_->told() : nullptr;
    const bool of_the_table = told != nullptr && bodies_->poses().size() == told->bodies;
    frame_.poses = of_the_table ? told->placed(bodies_->poses()) : bodies_->poses();
    frame_.simulated_s = bodies_->simulated_s();
    fresh = true;
    const bool fits = frame_.poses.size() == scene_->order.size();
    if (!fits)
      problem_ = "the scene file is not the one that the session runs: it has changed since; restart the session";
  }
  if (soft_ && soft_->drain()) {
    frame_.soft_nodes_m = soft_->nodes_m();
    fresh = true;
  }
  if (!fresh) return;
  ++frame_.poses_number;
  ++frame_.number;
  frame_.poses_s = now_s();
}

std::string LiveSource::physics_trouble() const {
  for (const tools::PhysicsView& node : seen_.physics) {
    const std::string life = tools::life_text(node.life);
    if (life == "GONE") return "its process has ended";
    if (life.starts_with("STALE")) return "its process is stopped or starved";
  }
  return "";
}

void LiveSource::judge_hands() {
  Json state = {{"type", "state"}, {"session", seen_.session}, {"word", "WAITING"}, {"level", "warn"}};
  state["reason"] = problem_.empty() ? seen_.message : problem_;
  state["problem"] = problem_.empty() ? Json(nullptr) : Json(problem_);
  state["hands"] = Json::array();
  if (scene_ && seen_.session.empty()) {
    state["word"] = "ENDED";
    state["reason"] = "session " + session_.name + " has ended; the picture is its last one. " + seen_.message;
  } else if (scene_) {
    const std::string physics = physics_trouble();
    std::optional<HandState> worst;
    for (const LiveHand& hand : hands_) {
      const HandState each = hand.state(physics);
      state["hands"].push_back(
          {{"name", hand.name()}, {"word", each.word}, {"level", to_string(each.level)}, {"reason", each.reason}});
      if (!worst || each.level > worst->level) worst = each;
    }
    if (worst) {
      state["word"] = worst->word;
      state["level"] = to_string(worst->level);
      state["reason"] = worst->reason;
    }
  }
  state_.set(std::move(state));
}

void LiveSource::follow() {
  if (rtbus::monotonic_ns() >= looked_ns_ + kLook_ns) look_around();
  if (scene_) {
    follow_bodies();
    frame_.contacts.clear();
    for (std::size_t i = 0; i < hands_.size(); ++i) {
      if (hands_[i].follow(kHistory_s, frame_.hands[i])) ++frame_.number;
      hands_[i].add_contacts(static_cast<std::uint32_t>(i), frame_.hands[i], frame_.contacts);
    }
  }
  judge_hands();
}

}  // namespace view
