#include "tools/cli/common/link_json.hpp"

namespace tools {

nlohmann::ordered_json link_json(const rtbus::LinkStats& link) {
  return {{"state", rtbus::to_string(static_cast<rtbus::LinkState>(link.state))},
          {"exchanges", link.exchanges},
          {"lost_frames", link.lost_frames},
          {"bad_frames", link.bad_frames},
          {"resyncs", link.resyncs},
          {"line_errors", link.line_errors},
          {"limited", link.limited},
          {"silences", link.silences},
          {"late_forces", link.late_forces},
          {"timed_out", link.timed_out},
          {"withheld", link.withheld},
          {"losses", link.losses},
          {"sample_to_wire_us", {{"p50", link.sample_to_wire_p50_us}, {"p99", link.sample_to_wire_p99_us}}},
          {"period_us", {{"p50", link.period_p50_us}, {"p99", link.period_p99_us}}}};
}

}  // namespace tools
