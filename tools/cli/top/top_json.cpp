#include "tools/cli/top/top_json.hpp"

#include "tools/cli/common/link_json.hpp"
#include "tools/cli/top/top_node_lines.hpp"

namespace tools {

namespace {

using Json = nlohmann::ordered_json;

template <class T>
Json or_null(const std::optional<T>& value) {
  return value ? Json(*value) : Json(nullptr);
}

Json life_json(const NodeLife& life) {
  return {{"state", life_text(life)},
          {"alive", life_text(life) == "alive"},
          {"writer_alive", life.writer_alive},
          {"heartbeat_age_s", or_null(life.heartbeat_age_s)},
          {"pid", life.pid},
          {"restarts", life.restarts},
          {"process_age_s", life.process_age_s}};
}

Json stats_json(const rtbus::LoopStats& s) {
  Json json;
  json["rate_hz"] = s.achieved_hz;
  json["rate_asked_hz"] = s.rate_hz;
  json["ticks"] = s.ticks;
  json["ticks_due"] = s.ticks_due;
  json["overruns"] = s.overruns;
  json["wakeup_latency_us"] = {
      {"p50", s.wakeup_p50_us}, {"p99", s.wakeup_p99_us}, {"p999", s.wakeup_p999_us}, {"max", s.wakeup_max_us}};
  json["compute_us"] = {{"p50", s.compute_p50_us}, {"p99", s.compute_p99_us}, {"max", s.compute_max_us}};
  json["device_us"] = {{"p50", s.device_p50_us}, {"p99", s.device_p99_us}, {"max", s.device_max_us}};
  json["proxy_age_ms"] = {{"p50", s.proxy_age_p50_ms}, {"p99", s.proxy_age_p99_ms}, {"max", s.proxy_age_max_ms}};
  json["correction_mm"] = {{"mean", s.correction_mean_mm}, {"max", s.correction_max_mm}, {"answers", s.corrections}};
  json["energy_j"] = {{"absorbed", s.energy_absorbed_j}, {"injected", s.energy_removed_j}};
  json["safety"] = {{"clamped", s.clamped},
                    {"slew_limited", s.slew_limited},
                    {"stale_ticks", s.stale_ticks},
                    {"nonfinite", s.nonfinite},
                    {"overspeed", s.overspeed},
                    {"thermal_limited", s.thermal_limited},
                    {"passivity_ticks", s.passivity_ticks},
                    {"device_lost", s.device_lost},
                    {"losses", s.losses},
                    {"pauses", s.pauses}};
  return json;
}

/// The last 10 s, from the telemetry.
Json recent_json(const RecentView& recent) {
  Json json = {{"ticks", recent.ticks},
               {"missed", recent.missed},
               {"wakeup_max_us", recent.wakeup_max_us},
               {"compute_max_us", recent.compute_max_us},
               {"jitter", {{"upper_edge_us", kJitterEdges_us}, {"ticks", recent.jitter}}}};
  json["last_cut"] = nullptr;
  if (recent.cut) {
    json["last_cut"] = {{"why", cut_text(recent.cut->bits)},
                        {"began_ago_s", recent.cut->began_ago_s},
                        {"lasted_s", recent.cut->lasted_s},
                        {"ongoing", recent.cut->ongoing}};
  }
  return json;
}

Json haptic_json(const HapticView& view) {
  Json json = {{"name", view.name}, {"life", life_json(view.life)}};
  if (view.info) {
    json["device"] = rtbus::text_of(view.info->kind);
    json["method"] = rtbus::text_of(view.info->method);
    json["clock"] = rtbus::text_of(view.info->clock);
    json["scheduling"] = rtbus::text_of(view.info->scheduling);
    json["realtime"] = rtbus::text_of(view.info->realtime);
    json["left_out"] = rtbus::text_of(view.info->left_out);
  }
  if (view.stats) json.update(stats_json(*view.stats));
  if (view.stats) {
    json["force_n"] = {{"now", or_null(view.force_n)},
                       {"rms", view.stats->force_rms_n},
                       {"peak", view.stats->force_peak_n},
                       {"limit", view.info ? Json(view.info->force_limit_n) : Json(nullptr)}};
    json["last_loss_age_s"] = or_null(view.loss_age_s);
  }
  json["estop"] = view.estop ? Json(*view.estop) : Json(nullptr);
  if (view.link) json["link"] = link_json(*view.link);
  json["recent"] = view.recent ? recent_json(*view.recent) : Json(nullptr);
  if (view.device) {
    json["position_m"] = view.device->position_m;
    json["velocity_m_s"] = view.device->velocity_m_s;
    json["buttons"] = view.device->buttons;
    json["enabled"] = view.device->enabled != 0;
  }
  return json;
}

Json physics_json(const PhysicsView& view) {
  Json json = {{"name", view.name}, {"life", life_json(view.life)}};
  if (view.info) {
    json["engine"] = rtbus::text_of(view.info->kind);
    json["clock"] = rtbus::text_of(view.info->clock);
    json["bodies"] = view.info->bodies;
    json["scheduling"] = rtbus::text_of(view.info->scheduling);
    json["realtime"] = rtbus::text_of(view.info->realtime);
    json["left_out"] = rtbus::text_of(view.info->left_out);
  }
  if (view.stats) {
    json["rate_hz"] = view.stats->achieved_hz;
    json["rate_asked_hz"] = view.stats->rate_hz;
    json["steps"] = view.stats->steps;
    json["steps_due"] = view.stats->due;
    json["late"] = view.stats->late;
    json["simulated_s"] = view.stats->simulated_s;
    json["step_ms"] = {
        {"p50", view.stats->step_p50_ms}, {"p99", view.stats->step_p99_ms}, {"max", view.stats->step_max_ms}};
  }
  return json;
}

}  // namespace

nlohmann::ordered_json top_json(const TopSnapshot& snapshot) {
  Json json = {{"schema", "rtbus-top/1"}, {"session", snapshot.session}, {"uptime_s", snapshot.uptime_s}};
  json["message"] = snapshot.message.empty() ? Json(nullptr) : Json(snapshot.message);
  json["haptic"] = Json::array();
  for (const HapticView& view : snapshot.haptic) json["haptic"].push_back(haptic_json(view));
  json["physics"] = Json::array();
  for (const PhysicsView& view : snapshot.physics) json["physics"].push_back(physics_json(view));
  json["topics"] = Json::array();
  for (const TopicView& topic : snapshot.topics) {
    json["topics"].push_back({{"name", topic.name},
                              {"rate_hz", or_null(topic.rate_hz)},
                              {"published", topic.published},
                              {"writer_pid", topic.writer_pid},
                              {"writer_alive", topic.writer_alive},
                              {"problem", topic.problem.empty() ? Json(nullptr) : Json(topic.problem)}});
  }
  return json;
}

}  // namespace tools
