#include "drivers/replay/replay_config.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "drivers/replay/replay_device.hpp"
#include "drivers/simulated/model_config.hpp"
#include "rtbus/recording/reader.hpp"

namespace drivers::replay {
namespace {

using rtbus::recording::RecordedTopic;
using rtbus::recording::Recording;

/// The file may hold anything: what does not fit the buttons is none.
constexpr double kMostButtons = std::numeric_limits<std::uint32_t>::max();

struct Settings {
  std::string file;
  std::string topic;  ///< Empty: the only one of type rtbus/DeviceState.
  double from_s = 0.0;
  double to_s = std::numeric_limits<double>::infinity();
  DeviceInfo info;
};

/// The topic that holds the motion, or why there is none.
rtbus::Result<const RecordedTopic*, DeviceFault> find_motion(const Recording& recording, const Settings& settings) {
  std::string names;
  const RecordedTopic* found = nullptr;
  std::size_t count = 0;
  for (const RecordedTopic& topic : recording.topics()) {
    if (topic.type_name != "rtbus/DeviceState") continue;
    names += (names.empty() ? "" : ", ") + topic.name;
    ++count;
    if (settings.topic.empty() || topic.name == settings.topic || topic.name == settings.topic + ".device_state") {
      if (found == nullptr) found = &topic;
    }
  }
  if (count == 0) {
    return rtbus::Failure{DeviceFault{settings.file + " holds no motion; record the topic NODE.device_state"}};
  }
  if (found == nullptr || (settings.topic.empty() && count > 1)) {
    return rtbus::Failure{DeviceFault{settings.file + " holds the motions " + names + "; choose with `topic:`"}};
  }
  return found;
}

rtbus::Result<Motion, DeviceFault> load(const Settings& settings) {
  const auto recording = Recording::open(settings.file);
  if (!recording) return rtbus::Failure{DeviceFault{recording.error().message}};
  const auto topic = find_motion(*recording, settings);
  if (!topic) return rtbus::Failure{topic.error()};
  std::array<std::vector<double>, 3> position;
  std::array<std::vector<double>, 4> orientation;
  for (std::uint32_t i = 0; i < 3; ++i) position[i] = recording->column(**topic, "position_m", i);
  for (std::uint32_t i = 0; i < 4; ++i) orientation[i] = recording->column(**topic, "orientation_wxyz", i);
  const auto buttons = recording->column(**topic, "buttons");
  // As integers: a double has no room for nanoseconds since boot.
  const auto times = recording->integers(**topic, "sample_time_ns");
  if (times.size() != buttons.size() || times.size() != position[2].size() || times.size() != orientation[3].size()) {
    return rtbus::Failure{DeviceFault{settings.file + ": the topic " + (*topic)->name + " lacks fields"}};
  }
  Motion motion;
  for (std::size_t i = 0; i < times.size(); ++i) {
    const double t_s = 1e-9 * static_cast<double>(static_cast<std::int64_t>(times[i] - times.front()));
    if (t_s < settings.from_s || t_s > settings.to_s) continue;
    if (!motion.empty() && times[i] <= motion.back().time_ns) continue;  // the same measurement, published again
    DeviceSample sample;
    sample.time_ns = times[i];
    for (std::size_t k = 0; k < 3; ++k) sample.position_m[k] = position[k][i];
    for (std::size_t k = 0; k < 4; ++k) sample.orientation_wxyz[k] = orientation[k][i];
    sample.buttons = buttons[i] >= 0.0 && buttons[i] <= kMostButtons ? static_cast<std::uint32_t>(buttons[i]) : 0;
    motion.push_back(sample);
  }
  if (motion.size() < 2) {
    return rtbus::Failure{DeviceFault{
        settings.file + ": no motion between from_s and to_s; the recording lasts " +
        std::to_string(times.empty() ? 0.0 : 1e-9 * static_cast<double>(times.back() - times.front())) + " s"}};
  }
  return motion;
}

class ReplayConfig final : public DeviceConfig {
 public:
  explicit ReplayConfig(Settings settings) : settings_(std::move(settings)) {}
  [[nodiscard]] const DeviceInfo& info() const noexcept override { return settings_.info; }
  [[nodiscard]] rtbus::Result<std::unique_ptr<Device>, DeviceFault> open(const OpenContext&) const override {
    auto motion = load(settings_);
    if (!motion) return rtbus::Failure{motion.error()};
    std::unique_ptr<Device> device = std::make_unique<ReplayDevice>(settings_.info, std::move(*motion));
    return device;
  }

 private:
  Settings settings_;
};

}  // namespace

std::unique_ptr<DeviceConfig> parse(rtbus::config::Map& file) {
  Settings settings;
  settings.file = file.existing_file("file");
  settings.topic = file.text("topic", "");
  settings.from_s = file.number("from_s", {0.0, 1e6}, 0.0);
  settings.to_s = file.number("to_s", {0.0, 1e6}, 1e6);
  if (settings.to_s <= settings.from_s) file.fail("to_s", "is not after from_s; raise it");
  settings.info = simulated::parse_model_info(file);
  // Here already: a wrong file is found before anything starts.
  const auto recording = Recording::open(settings.file);
  if (!recording) file.fail("file", "cannot be replayed: " + recording.error().message);
  if (const auto motion = find_motion(*recording, settings); !motion) {
    file.fail(settings.topic.empty() ? "file" : "topic", "cannot be replayed: " + motion.error().message);
  }
  settings.info.serial = "replay";
  settings.info.model = "replay " + settings.info.model;  // for whoever reads the report
  return std::make_unique<ReplayConfig>(std::move(settings));
}

}  // namespace drivers::replay
