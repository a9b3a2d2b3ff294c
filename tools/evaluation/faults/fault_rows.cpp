#include <algorithm>
#include <iterator>

#include "tools/evaluation/faults/fault_row.hpp"

namespace tools {

const std::vector<FaultRow>& fault_rows() {
  static const std::vector<FaultRow> rows = [] {
    std::vector<FaultRow> out;
    for (const auto family : {&node_faults, &supervisor_faults, &topic_faults, &observer_faults, &bridge_faults,
                              &resource_faults, &machine_faults, &engine_faults, &device_faults}) {
      std::vector<FaultRow> more = family();
      std::move(more.begin(), more.end(), std::back_inserter(out));
    }
    return out;
  }();
  return rows;
}

const FaultRow* find_fault_row(const std::string& name) {
  const auto& rows = fault_rows();
  const auto found = std::find_if(rows.begin(), rows.end(), [&](const FaultRow& row) { return row.name == name; });
  return found == rows.end() ? nullptr : &*found;
}

}  // namespace tools
