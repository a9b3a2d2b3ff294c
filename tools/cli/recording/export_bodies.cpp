#include "tools/cli/recording/export_bodies.hpp"

#include <algorithm>
#include <cstring>
#include <ostream>
#include <string>
#include <vector>

#include "rtbus/messages.hpp"
#include "tools/cli/common/formatted.hpp"
#include "tools/cli/common/interrupt.hpp"

namespace tools {
namespace {

using rtbus::BodyPoses;

constexpr std::uint64_t kSamplesAtOnce = 1024;
constexpr std::size_t kNumbers = 7;  ///< p_WB and q_WB of one body.

/// The samples of one frame, put together.
class Frame {
 public:
  explicit Frame(std::size_t bodies) : pose_(bodies * kNumbers) {}

  /// @returns true when `sample` completes its frame.
  bool take(const BodyPoses& sample) {
    if (sample.frame != frame_) frame_ = sample.frame, next_body_ = 0;
    const std::size_t bodies = pose_.size() / kNumbers;
    if (sample.bodies != bodies || sample.first_body != next_body_ || sample.count > BodyPoses::kBodies ||
        next_body_ + sample.count > bodies) {
      next_body_ = bodies + 1;  // a sample of it was lost
      return false;
    }
    for (std::size_t i = 0; i < sample.count; ++i) {
      double* const to = &pose_[(next_body_ + i) * kNumbers];
      std::copy(sample.position_m[i].begin(), sample.position_m[i].end(), to);
      std::copy(sample.orientation_wxyz[i].begin(), sample.orientation_wxyz[i].end(), to + 3);
    }
    next_body_ += sample.count;
    return next_body_ == bodies;
  }
  [[nodiscard]] const std::vector<double>& pose() const noexcept { return pose_; }

 private:
  std::vector<double> pose_;
  std::uint64_t frame_ = 0;
  std::size_t next_body_ = 0;
};

}  // namespace

bool has_named_bodies(const rtbus::recording::Recording& recording, const rtbus::recording::RecordedTopic& topic) {
  return topic.type_name == rtbus::SampleTraits<BodyPoses>::kName && topic.sample_bytes == sizeof(BodyPoses) &&
         !recording.body_names().empty();
}

std::uint64_t write_named_bodies(const rtbus::recording::Recording& recording,
                                 const rtbus::recording::RecordedTopic& topic, std::ostream& out) {
  const std::vector<std::string> names = recording.body_names();
  out << "stamp_ns [ns],step_index [1],simulated_s [s]";
  for (const std::string& name : names) {
    for (const char* const each : {".x [m]", ".y [m]", ".z [m]", ".qw [1]", ".qx [1]", ".qy [1]", ".qz [1]"}) {
      out << ',' << name << each;
    }
  }
  out << '\n';
  Frame frame(names.size());
  std::uint64_t written = 0;
  for (std::uint64_t first = 0; first < topic.rows && !interrupted(); first += kSamplesAtOnce) {
    const auto stamps = recording.stamps_ns(topic, first, kSamplesAtOnce);
    const auto bytes = recording.samples(topic, first, kSamplesAtOnce);
    for (std::size_t i = 0; i < stamps.size() && (i + 1) * sizeof(BodyPoses) <= bytes.size(); ++i) {
      BodyPoses sample;
      std::memcpy(&sample, bytes.data() + i * sizeof sample, sizeof sample);
      if (!frame.take(sample)) continue;
      out << stamps[i] << ',' << sample.step_index << ',' << formatted("%.9g", sample.simulated_s);
      for (const double value : frame.pose()) out << ',' << formatted("%.9g", value);
      out << '\n';
      ++written;
    }
  }
  return written;
}

}  // namespace tools
