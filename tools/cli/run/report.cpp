#include "tools/cli/run/report.hpp"

#include <algorithm>
#include <cmath>
#include <string_view>
#include <utility>

#include "tools/cli/common/link_json.hpp"

namespace tools {

namespace {

using Json = nlohmann::ordered_json;

/// A figure that is not one (0/0 of a run too short) is null, for JSON knows no NaN.
Json number(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

std::vector<std::string> split_list(std::string_view list) {
  std::vector<std::string> items;
  while (!list.empty()) {
    const std::size_t end = std::min(list.find(','), list.size());
    std::string_view item = list.substr(0, end);
    list.remove_prefix(std::min(end + 1, list.size()));
    while (item.starts_with(' ')) item.remove_prefix(1);
    if (!item.empty()) items.emplace_back(item);
  }
  return items;
}

Json per_second(double cost_s, double seconds) { return seconds > 0.0 ? number(cost_s / seconds) : Json(nullptr); }

Json force_error(const HapticFigures& haptic) {
  Json out{{"rms", nullptr}, {"peak", nullptr}, {"reference", nullptr}};
  if (haptic.error) {
    out["rms"] = number(haptic.error->force_n.rms());
    out["peak"] = number(haptic.error->force_n.peak);
    out["reference"] = "staleness: the same method with the proxy that physics published for that instant";
    out["ticks"] = haptic.error->force_n.count;
    out["ticks_without_reference"] = haptic.error->dropped;
  } else if (haptic.needs_physics && !haptic.finds_proxy) {
    out["reason"] = "no tick lies between two proxies of physics: the run was too short, or physics was away";
  } else {
    out["reason"] = "the method finds its proxy in the haptic loop itself, so it is never stale";
  }
  return out;
}

Json position_error(const HapticFigures& haptic) {
  Json out{{"rms", nullptr}, {"peak", nullptr}};
  if (haptic.error) {
    out["rms"] = number(haptic.error->position_m.rms());
    out["peak"] = number(haptic.error->position_m.peak);
  }
  return out;
}

Json proxy_age(const HapticFigures& haptic) {
  const rtbus::LoopStats& s = haptic.stats;
  if (!haptic.needs_physics) return {{"p50", nullptr}, {"p99", nullptr}, {"max", nullptr}};
  return {
      {"p50", number(s.proxy_age_p50_ms)}, {"p99", number(s.proxy_age_p99_ms)}, {"max", number(s.proxy_age_max_ms)}};
}

std::size_t restarts_of(const RunReport& report, const std::string& node) {
  return static_cast<std::size_t>(std::count_if(report.restarts.begin(), report.restarts.end(),
                                                [&](const RestartFigures& each) { return each.node == node; }));
}

Json restart_json(const RestartFigures& restart) {
  return {{"node", restart.node},
          {"how", restart.how},
          {"exit_status", restart.status ? Json(*restart.status) : Json(nullptr)},
          {"signal", restart.signal ? Json(*restart.signal) : Json(nullptr)},
          {"at_s", number(restart.at_s)},
          {"lived_s", number(restart.lived_s)},
          {"delay_s", number(restart.delay_s)}};
}

/// By how much answers moved what the hand touched; null where a method simulates nothing, or nothing was touched.
Json correction(const rtbus::LoopStats& s) {
  if (s.corrections == 0) return nullptr;
  return {{"mean", number(s.correction_mean_mm)}, {"max", number(s.correction_max_mm)}, {"answers", s.corrections}};
}

Json haptic_json(const HapticFigures& haptic, double duration_s) {
  const rtbus::LoopStats& s = haptic.stats;
  const rtbus::NodeInfo& info = haptic.info;
  return {
      {"name", haptic.name},
      {"device", rtbus::text_of(info.kind)},
      {"method", rtbus::text_of(info.method)},
      {"clock", rtbus::text_of(info.clock)},
      {"rate_hz", number(info.rate_hz)},
      {"achieved_hz", number(s.achieved_hz)},
      {"ticks", s.ticks},
      {"ticks_due", s.ticks_due},
      {"overruns", s.overruns},
      {"scheduling", rtbus::text_of(info.scheduling)},
      {"realtime", rtbus::text_of(info.realtime)},
      {"wakeup_latency_us",
       {{"p50", number(s.wakeup_p50_us)},
        {"p99", number(s.wakeup_p99_us)},
        {"p999", number(s.wakeup_p999_us)},
        {"max", number(s.wakeup_max_us)}}},
      {"compute_us",
       {{"p50", number(s.compute_p50_us)}, {"p99", number(s.compute_p99_us)}, {"max", number(s.compute_max_us)}}},
      {"device_us",
       {{"p50", number(s.device_p50_us)}, {"p99", number(s.device_p99_us)}, {"max", number(s.device_max_us)}}},
      {"proxy_age_ms", proxy_age(haptic)},
      {"correction_mm", correction(s)},
      {"force_n", {{"rms", number(s.force_rms_n)}, {"peak", number(s.force_peak_n)}}},
      {"force_error_n", force_error(haptic)},
      {"position_error_m", position_error(haptic)},
      {"energy_j",
       {{"absorbed", number(s.energy_absorbed_j)},
        {"removed_by_damper", number(s.energy_removed_j)},
        {"generated_peak", number(haptic.generated_peak_j)},
        {"observed_min", number(haptic.observed_min_j)}}},
      {"safety",
       {{"clamped", s.clamped},
        {"slew_limited", s.slew_limited},
        {"stale_ticks", s.stale_ticks},
        {"nonfinite", s.nonfinite},
        {"overspeed", s.overspeed},
        {"thermal_limited", s.thermal_limited},
        {"passivity_ticks", s.passivity_ticks},
        {"device_lost", s.device_lost},
        {"losses", s.losses},
        {"pauses", s.pauses}}},
      {"link", haptic.link ? link_json(*haptic.link) : Json(nullptr)},
      {"stiffness_n_per_m",
       {{"requested", number(info.stiffness_requested_n_per_m)},
        {"rendered", number(info.stiffness_rendered_n_per_m)}}},
      {"damping_n_s_per_m",
       {{"requested", number(info.damping_requested_n_s_per_m)},
        {"rendered", number(info.damping_rendered_n_s_per_m)}}},
      {"force_limit_n", number(info.force_limit_n)},
      {"observed_ticks", haptic.observed_ticks},
      {"missed_by_observer", haptic.missed_by_observer},
      {"left_out", split_list(rtbus::text_of(info.left_out))},
      {"rss_mib", number(haptic.cost.rss_mib)},
      {"threads", haptic.cost.threads},
      {"cpu_s_per_s", per_second(haptic.cost.cpu_s, duration_s)},
  };
}

Json bare_json(const BareLoopFigures& bare) {
  return {{"beside", bare.beside},
          {"rate_hz", number(bare.rate_hz)},
          {"scheduling", bare.scheduling},
          {"realtime", bare.granted},
          {"ticks", bare.ticks},
          {"due", bare.due},
          {"overruns", bare.overruns},
          {"wakeup_latency_us",
           {{"p50", number(bare.wakeup_p50_us)},
            {"p99", number(bare.wakeup_p99_us)},
            {"p999", number(bare.wakeup_p999_us)},
            {"max", number(bare.wakeup_max_us)}}}};
}

Json physics_json(const PhysicsFigures& physics, double duration_s) {
  const rtbus::StepStats& s = physics.stats;
  Json proxies = Json::array();
  for (const ProxyFigures& proxy : physics.proxies) {
    proxies.push_back(
        {{"device", proxy.device},
         {"published", proxy.published},
         {"in_contact", proxy.in_contact},
         {"coupling_force_n", {{"rms", number(proxy.coupling_n.rms())}, {"peak", number(proxy.coupling_n.peak)}}},
         {"contact_force_n", {{"rms", number(proxy.contact_n.rms())}, {"peak", number(proxy.contact_n.peak)}}},
         {"impulse_n_s",
          {{"seconds_compared", proxy.impulse.windows},
           {"hand", number(proxy.impulse.hand_n_s)},
           {"world", number(proxy.impulse.world_n_s)},
           {"worst_second", proxy.impulse.windows > 0 ? number(proxy.impulse.worst) : Json(nullptr)}}}});
  }
  // The node's cost was measured while all ran, its simulated time since it started: bring both to the same seconds.
  const double simulated_per_s = s.steps > 0 ? s.achieved_hz * s.simulated_s / static_cast<double>(s.steps) : 0.0;
  return {{"engine", rtbus::text_of(physics.info.kind)},
          {"clock", rtbus::text_of(physics.info.clock)},
          {"rate_hz", number(s.rate_hz)},
          {"achieved_hz", number(s.achieved_hz)},
          {"steps", s.steps},
          {"steps_due", s.due},
          {"late", s.late},
          {"simulated_s", number(s.simulated_s)},
          {"real_time_factor", number(s.wall_s > 0.0 ? s.simulated_s / s.wall_s : 0.0)},
          {"step_ms", {{"p50", number(s.step_p50_ms)}, {"p99", number(s.step_p99_ms)}, {"max", number(s.step_max_ms)}}},
          {"bodies", s.bodies},
          {"proxies", proxies},
          {"left_out", split_list(rtbus::text_of(physics.info.left_out))},
          {"rss_mib", number(physics.cost.rss_mib)},
          {"threads", physics.cost.threads},
          {"cpu_s_per_s", per_second(physics.cost.cpu_s, duration_s)},
          {"cpu_s_per_simulated_s", per_second(physics.cost.cpu_s, duration_s * simulated_per_s)}};
}

}  // namespace

nlohmann::ordered_json to_json(const RunReport& report) {
  const MachineFacts& machine = report.machine;
  Json json{{"schema", "rtbus-report/1"},
            {"version", RTBUS_VERSION},
            {"config", report.config},
            {"set", report.overrides},
            {"session", report.session},
            {"scene", report.scene},
            {"started_utc", report.started_utc},
            {"duration_s", number(report.duration_s)},
            {"wall_s", number(report.wall_s)},
            {"ended", report.ended},
            {"warnings", report.warnings},
            {"faults", report.faults},
            {"restarts", Json::array()},
            {"machine",
             {{"cpu", machine.cpu},
              {"cores", machine.cores},
              {"kernel", machine.kernel},
              {"realtime", machine.preemption},
              {"virtualization", machine.virtualization},
              {"clocksource", machine.clocksource},
              {"governor", machine.governor},
              {"isolated_cores", machine.isolated_cores}}}};
  json["haptic"] = Json::array();
  for (const HapticFigures& haptic : report.haptic) {
    json["haptic"].push_back(haptic_json(haptic, report.duration_s));
    json["haptic"].back()["restarts"] = restarts_of(report, haptic.name);
  }
  json["bare_loop"] = report.bare_loop ? bare_json(*report.bare_loop) : Json(nullptr);
  json["physics"] = report.physics ? physics_json(*report.physics, report.duration_s) : Json(nullptr);
  if (report.physics) json["physics"]["restarts"] = restarts_of(report, "physics");
  for (const RestartFigures& restart : report.restarts) json["restarts"].push_back(restart_json(restart));
  Json topics = Json::array();
  for (const TopicFigures& topic : report.topics) {
    topics.push_back({{"name", topic.name},
                      {"type", topic.type},
                      {"sample_bytes", topic.sample_bytes},
                      {"published", topic.published},
                      {"rate_hz", number(topic.rate_hz)}});
  }
  json["bus"] = {{"shm_bytes", report.shm_bytes}, {"topics", topics}};
  json["recordings"] = report.recordings;
  json["figures"] = report.figures;
  return json;
}

}  // namespace tools
