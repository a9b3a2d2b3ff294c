// Device files: the shipped ones are right, wrong ones are refused with a sentence that helps.
#include "drivers/simulated/simulated_config.hpp"

#include <unistd.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "drivers/registry/registry.hpp"
#include "drivers/simulated/models.hpp"
#include "rtbus/config/document.hpp"

namespace drivers {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

std::filesystem::path device_folder() { return std::filesystem::path(RTBUS_SOURCE_DIR) / "config" / "devices"; }

std::unique_ptr<DeviceConfig> parse_text(const std::string& text) {
  const auto path = std::filesystem::temp_directory_path() / ("device_" + std::to_string(::getpid()) + ".yaml");
  std::ofstream(path) << text;
  auto map = rtbus::config::load(path.string());
  std::filesystem::remove(path);
  return parse_device(map);
}

std::string refusal(const std::string& keys) {
  try {
    (void)parse_text("schema: device/1\ndriver: simulated\n" + keys);
  } catch (const rtbus::config::Error& error) {
    return error.what();
  }
  return "accepted";
}

const simulated::SimulatedSettings& settings(const DeviceConfig& config) {
  return dynamic_cast<const simulated::SimulatedConfig&>(config).settings();
}

TEST(DeviceFiles, AllShippedOnesAreAccepted) {
  int files = 0;
  for (const auto& entry : std::filesystem::directory_iterator(device_folder())) {
    if (entry.path().extension() != ".yaml" || !entry.path().filename().string().starts_with("sim_")) continue;
    auto map = rtbus::config::load(entry.path().string());
    EXPECT_NO_THROW((void)parse_device(map)) << entry.path();
    ++files;
  }
  EXPECT_GE(files, 7);
}

TEST(DeviceFiles, DocumentedDefaultsAreTheModels) {
  // sim_phantom_desktop.yaml spells every key out; an empty file must give the same device.
  auto map = rtbus::config::load((device_folder() / "sim_phantom_desktop.yaml").string());
  const auto spelled = parse_device(map);
  const auto empty = parse_text("schema: device/1\ndriver: simulated\n");
  const auto& a = settings(*spelled);
  const auto& b = settings(*empty);
  EXPECT_EQ(a.mechanics.mass_kg, b.mechanics.mass_kg);
  EXPECT_EQ(a.mechanics.viscous_n_s_per_m, b.mechanics.viscous_n_s_per_m);
  EXPECT_EQ(a.mechanics.coulomb_n, b.mechanics.coulomb_n);
  EXPECT_EQ(a.mechanics.gravity_m_s2, b.mechanics.gravity_m_s2);
  EXPECT_NEAR(a.mechanics.force_step_n, b.mechanics.force_step_n, 1e-6);
  EXPECT_EQ(a.mechanics.position_quantum_m, b.mechanics.position_quantum_m);
  EXPECT_EQ(a.mechanics.sample_jitter_ns, b.mechanics.sample_jitter_ns);
  EXPECT_EQ(a.mechanics.jitter_seed, b.mechanics.jitter_seed);
  EXPECT_EQ(a.mechanics.step_ns, b.mechanics.step_ns);
  EXPECT_EQ(a.mechanics.end_stops, b.mechanics.end_stops);
  EXPECT_EQ(a.mechanics.start_position_m, b.mechanics.start_position_m);
  EXPECT_EQ(a.info.max_force_n, b.info.max_force_n);
  EXPECT_EQ(a.info.continuous_force_n, b.info.continuous_force_n);
  EXPECT_EQ(a.info.thermal_time_constant_s, b.info.thermal_time_constant_s);
  EXPECT_EQ(a.info.max_slew_n_per_ms, b.info.max_slew_n_per_ms);
  EXPECT_EQ(a.info.max_stiffness_n_per_m, b.info.max_stiffness_n_per_m);
  EXPECT_EQ(a.info.max_speed_m_s, b.info.max_speed_m_s);
  EXPECT_EQ(a.info.workspace_min_m, b.info.workspace_min_m);
  EXPECT_EQ(a.info.workspace_max_m, b.info.workspace_max_m);
  EXPECT_EQ(a.info.force_timeout_s, b.info.force_timeout_s);
  EXPECT_EQ(a.sample_rate_hz, b.sample_rate_hz);
  EXPECT_EQ(a.plant_rate_hz, b.plant_rate_hz);
  EXPECT_EQ(a.own_process, b.own_process);
}

TEST(DeviceFiles, PromiseLessFrictionThanThePlantHas) {
  for (const simulated::Model& model : simulated::models()) {
    const auto config = parse_text("schema: device/1\ndriver: simulated\nmodel: " + std::string(model.name) + "\n");
    const DeviceInfo& info = config->info();
    EXPECT_EQ(info.model, model.name);
    EXPECT_NEAR(info.coulomb_friction_n, 0.8 * model.mechanics.coulomb_n, 1e-12);
    EXPECT_NEAR(info.viscous_damping_n_s_per_m, 0.8 * model.mechanics.viscous_n_s_per_m, 1e-12);
    EXPECT_EQ(info.apparent_mass_kg, model.mechanics.mass_kg);
    // A wall as stiff as allowed, met at 0.6 m/s, must not run into the slew limit.
    EXPECT_GE(info.max_slew_n_per_ms, 2.0 * info.max_stiffness_n_per_m * 0.6 * 1e-3);
  }
}

TEST(DeviceFiles, OverrideTheModel) {
  const auto config = parse_text(
      "schema: device/1\ndriver: simulated\nmodel: falcon\nprocess: own\n"
      "mechanics: {mass_kg: 0.2, max_force_n: 3.0, force_timeout_ms: 35, integration_step_us: 50}\n"
      "hand: {type: hold, position_m: [0.01, 0.02, 0.03], impedance: firm, stiffness_n_per_m: 650}\n");
  EXPECT_TRUE(config->own_process());
  EXPECT_EQ(config->info().max_force_n, 3.0);
  EXPECT_EQ(config->info().continuous_force_n, 3.0);  // the model's 4 N do not outlive a peak of 3 N
  EXPECT_EQ(settings(*config).force_timeout_ns(), 35'000'000u);
  EXPECT_EQ(settings(*config).mechanics.step_ns, 50'000u);
  EXPECT_EQ(settings(*config).mechanics.start_position_m, Eigen::Vector3d(0.01, 0.02, 0.03));
  EXPECT_EQ(settings(*config).hand.impedance().stiffness_n_per_m, 650.0);
  EXPECT_EQ(settings(*config).hand.impedance().damping_n_s_per_m, 6.0);
}

TEST(DeviceFiles, WrongKeysAreRefusedWithTheirPlaceAndRemedy) {
  EXPECT_THAT(refusal("mechanics: {mas_kg: 0.05}\n"), AllOf(HasSubstr("mas_kg"), HasSubstr("mass_kg")));
  EXPECT_THAT(refusal("mechanics:\n  mass_kg: 90\n"), AllOf(HasSubstr(":4:"), HasSubstr("mechanics.mass_kg = 90")));
  EXPECT_THAT(refusal("mechanics: {integration_step_us: 5}\n"), HasSubstr("integration_step_us"));
  EXPECT_THAT(refusal("model: phantom_deskto\n"), HasSubstr("phantom_desktop"));
  EXPECT_THAT(refusal("limits: {continuous_force_n: 9}\n"), HasSubstr("exceeds the peak mechanics.max_force_n = 7.9"));
  EXPECT_THAT(refusal("limits: {workspace_min_m: [0.1, 0, 0]}\n"), HasSubstr("workspace_max_m"));
  EXPECT_THAT(refusal("start_position_m: [0, 0.5, 0]\n"), HasSubstr("outside the workspace"));
  EXPECT_THAT(refusal("hand: {type: hold, position_m: [0, 0.1, 0]}\n"), HasSubstr("outside the workspace"));
  EXPECT_THAT(refusal("hand: {type: sinosoid}\n"), HasSubstr("sinusoid"));
  EXPECT_THAT(refusal("hand: {type: hold}\n"), HasSubstr("position_m"));
  EXPECT_THAT(refusal("hand: {type: drop, position_m: [0, 0, 0], impedance: firm}\n"), HasSubstr("impedance"));
  EXPECT_THAT(refusal("hand: {type: push, start_m: [0, 0, 0], direction: [0, 0, 0], distance_m: 0.01}\n"),
              HasSubstr("has no length"));
  EXPECT_THAT(refusal("hand: {type: none, buttons: [{button: 1}]}\n"), HasSubstr("time_s"));
  EXPECT_THAT(refusal("hand: {type: waypoints, file: nowhere.csv}\n"), HasSubstr("nowhere.csv"));
}

TEST(DeviceFiles, UnknownDriverAndSchemaAreRefused) {
  EXPECT_THROW((void)parse_text("schema: device/2\ndriver: simulated\n"), rtbus::config::Error);
  EXPECT_THROW((void)parse_text("schema: device/1\ndriver: telepathy\n"), rtbus::config::Error);
  EXPECT_THROW((void)parse_text("schema: device/1\n"), rtbus::config::Error);
}

}  // namespace
}  // namespace drivers
