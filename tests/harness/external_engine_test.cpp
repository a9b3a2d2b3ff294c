// Through the interface of external engines nothing of the force is lost: Bullet behind it, beside Bullet in the node.
#include <cstdio>
#include <memory>

#include <gtest/gtest.h>

#include "tests/harness/outside_world.hpp"
#include "tools/evaluation/work_precision/work_precision.hpp"

namespace {

tools::PrecisionTrace run_outside(const tools::PrecisionScene& scene, const tools::PrecisionCell& cell) {
  std::vector<rtbus::config::Override> overrides;
  for (const std::string& text : tools::assignments_of(scene, cell)) {
    overrides.push_back(rtbus::config::parse_override(text));
  }
  auto session = rtbus::config::load_session(scene.session_file, overrides);
  tools::HarnessOptions options;
  options.around_world = [](std::unique_ptr<physics::World> world) -> std::unique_ptr<physics::World> {
    return std::make_unique<tests::OutsideWorld>(std::move(world));
  };
  tools::Harness harness(session, options);
  tools::PrecisionTrace trace;
  const auto axis = static_cast<std::size_t>(scene.axis);
  harness.run(scene.until_s, [&](const rtbus::Telemetry& tick) {
    trace.time_s.push_back(harness.now_s());
    trace.position_m.push_back(tick.position_m[axis]);
    trace.force_n.push_back(tick.force_n[axis]);
  });
  return trace;
}

TEST(ExternalEngine, FreeBlockIsFeltAsWithTheEngineInTheNode) {
  if (!RTBUS_WITH_BULLET) GTEST_SKIP() << "needs Bullet";
  tools::WorkPrecisionOptions options;
  options.block_file = RTBUS_SOURCE_DIR "/config/free_block.yaml";
  const tools::PrecisionScene scene = tools::block_scene(options);
  const tools::PrecisionTrace truth = tools::nearly_continuous(scene, 10000.0);
  for (const std::string method : {"local_contact", "remote_virtual_coupling"}) {
    for (const double rate_hz : {18.0, 43.0, 100.0}) {
      const tools::PrecisionCell cell{method, rate_hz};
      const auto inside = tools::error_of(tools::run_precisely(scene, cell), scene, tools::reference_of(truth));
      const auto outside = tools::error_of(run_outside(scene, cell), scene, tools::reference_of(truth));
      std::printf("%s, %g Hz: force error %.2f mN RMS in the node, %.2f mN outside\n", method.c_str(), rate_hz,
                  1e3 * inside.force_rms_n, 1e3 * outside.force_rms_n);
      EXPECT_LE(outside.force_rms_n, std::max(1.05 * inside.force_rms_n, inside.force_rms_n + 0.005))
          << method << ' ' << rate_hz;
    }
  }
}

}  // namespace
