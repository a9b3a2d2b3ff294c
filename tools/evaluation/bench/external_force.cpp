#include "tools/evaluation/bench/external_force.hpp"

#include <algorithm>
#include <memory>
#include <utility>

#include "tools/evaluation/bench/outside_world.hpp"
#include "tools/evaluation/work_precision/work_precision.hpp"

namespace tools {

double ExternalForce::most_n() const noexcept { return std::max(1.05 * inside_n, inside_n + 0.005); }

std::vector<ExternalForce> external_forces(const std::string& block_file) {
  WorkPrecisionOptions options;
  options.block_file = block_file;
  const PrecisionScene scene = block_scene(options);
  const PrecisionTrace truth = nearly_continuous(scene, 10000.0);
  const auto around = [](std::unique_ptr<physics::World> world) -> std::unique_ptr<physics::World> {
    return std::make_unique<OutsideWorld>(std::move(world));
  };
  std::vector<ExternalForce> out;
  for (const char* method : {"local_contact", "remote_virtual_coupling"}) {
    for (const double rate_hz : {18.0, 43.0, 100.0}) {
      const PrecisionCell cell{method, rate_hz};
      const auto error_n = [&](const PrecisionTrace& trace) {
        return error_of(trace, scene, reference_of(truth)).force_rms_n;
      };
      out.push_back(
          {method, rate_hz, error_n(run_precisely(scene, cell)), error_n(run_precisely(scene, cell, around))});
    }
  }
  return out;
}

void check_external_forces(const std::vector<ExternalForce>& forces, Experiment& experiment) {
  Table table{"force", {"method", "answers [Hz]", "in the node [mN]", "external [mN]", "at most [mN]"}, {}};
  for (const ExternalForce& force : forces) {
    table.rows.push_back(
        {force.method, force.rate_hz, 1e3 * force.inside_n, 1e3 * force.outside_n, 1e3 * force.most_n()});
    const std::string rate = std::to_string(static_cast<int>(force.rate_hz));
    experiment.check_at_most("force." + force.method + "." + rate + "hz",
                             "force error of the free block, external, " + force.method + ", " + rate + " Hz",
                             1e3 * force.outside_n, "mN", 1e3 * force.most_n());
  }
  experiment.add_table(std::move(table));
}

}  // namespace tools
