#pragma once
/// @file messages.hpp
/// ROS 2 messages as idlc generates them from ros2_messages.idl, filled from samples of the bus. The C structs refer to
/// texts and arrays that the classes here hold: one lives while it is written.
#include <array>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <ros2_messages.h>
#include "rtbus/messages.hpp"

namespace bridge {

using Header = std_msgs_msg_dds__Header_;
using PoseStamped = geometry_msgs_msg_dds__PoseStamped_;
using TwistStamped = geometry_msgs_msg_dds__TwistStamped_;
using WrenchStamped = geometry_msgs_msg_dds__WrenchStamped_;

/// From CLOCK_MONOTONIC to the time since 1970 that ROS 2 stamps with. Looks at both clocks anew once a second:
/// somebody may set the date.
class RosClock {
 public:
  [[nodiscard]] builtin_interfaces_msg_dds__Time_ time_of(std::uint64_t monotonic_ns);

 private:
  std::int64_t offset_ns_ = 0;
  std::uint64_t looked_ns_ = 0;
};

/// `frame` outlives the message.
[[nodiscard]] Header header_of(builtin_interfaces_msg_dds__Time_ stamp, const std::string& frame);
[[nodiscard]] PoseStamped pose_of(const Header& header, const rtbus::Vec3& position_m, const rtbus::Quat& orientation);
[[nodiscard]] TwistStamped twist_of(const Header& header, const rtbus::Vec3& linear_m_s,
                                    const rtbus::Vec3& angular_rad_s);
[[nodiscard]] WrenchStamped wrench_of(const Header& header, const rtbus::Vec3& force_n);

/// sensor_msgs/Joy: 32 buttons, as DeviceState has them; one axis, the opening of the gripper in metres.
class Joy {
 public:
  [[nodiscard]] const sensor_msgs_msg_dds__Joy_& fill(const Header& header, std::uint32_t buttons, double gripper_m);

 private:
  std::array<std::int32_t, 32> buttons_{};
  std::array<float, 1> axes_{};
  sensor_msgs_msg_dds__Joy_ message_{};
};

/// sensor_msgs/JointState: the device as a mechanism of three prismatic axes in its base frame.
class JointState {
 public:
  explicit JointState(const std::string& node) : names_{node + "/x", node + "/y", node + "/z"} {}
  /// @param force_n On the hand, in D.
  [[nodiscard]] const sensor_msgs_msg_dds__JointState_& fill(const Header& header, const rtbus::Vec3& position_m,
                                                             const rtbus::Vec3& velocity_m_s,
                                                             const rtbus::Vec3& force_n);

 private:
  std::array<std::string, 3> names_;
  std::array<char*, 3> name_pointers_{};
  std::array<double, 3> position_{}, velocity_{}, effort_{};
  sensor_msgs_msg_dds__JointState_ message_{};
};

/// tf2_msgs/TFMessage.
class Transforms {
 public:
  void clear() { rows_.clear(); }
  /// Copies the names.
  void add(builtin_interfaces_msg_dds__Time_ stamp, std::string parent, std::string child,
           const Eigen::Vector3d& position_m, const Eigen::Quaterniond& orientation);
  [[nodiscard]] bool empty() const noexcept { return rows_.empty(); }
  [[nodiscard]] const tf2_msgs_msg_dds__TFMessage_& message();

 private:
  struct Row {
    builtin_interfaces_msg_dds__Time_ stamp;
    std::string parent, child;
    geometry_msgs_msg_dds__Transform_ transform;
  };
  std::vector<Row> rows_;
  std::vector<geometry_msgs_msg_dds__TransformStamped_> out_;
  tf2_msgs_msg_dds__TFMessage_ message_{};
};

/// Levels of diagnostic_msgs/DiagnosticStatus.
enum class Level : std::uint8_t { kOk = 0, kWarn = 1, kError = 2, kStale = 3 };

/// A row of diagnostic_msgs/DiagnosticArray.
struct Status {
  Level level = Level::kOk;
  std::string name, message, hardware;
  std::vector<std::pair<std::string, std::string>> values;
};

class Diagnostics {
 public:
  [[nodiscard]] const diagnostic_msgs_msg_dds__DiagnosticArray_& fill(const Header& header, std::vector<Status> rows);

 private:
  std::vector<Status> rows_;
  std::vector<std::vector<diagnostic_msgs_msg_dds__KeyValue_>> values_;
  std::vector<diagnostic_msgs_msg_dds__DiagnosticStatus_> out_;
  diagnostic_msgs_msg_dds__DiagnosticArray_ message_{};
};

}  // namespace bridge
