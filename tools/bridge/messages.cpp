#include "tools/bridge/messages.hpp"

#include <time.h>

#include "rtbus/clock.hpp"

namespace bridge {

namespace {

std::int64_t realtime_ns() {
  timespec now{};
  ::clock_gettime(CLOCK_REALTIME, &now);
  return static_cast<std::int64_t>(now.tv_sec) * static_cast<std::int64_t>(rtbus::kNsPerS) + now.tv_nsec;
}

/// DDS reads through pointers that are not const, and changes nothing.
char* text(const std::string& value) { return const_cast<char*>(value.c_str()); }

geometry_msgs_msg_dds__Vector3_ vector_of(const rtbus::Vec3& v) { return {v[0], v[1], v[2]}; }

/// A sequence of idlc that refers to what somebody else holds.
template <class Sequence, class Array>
void refer(Sequence& sequence, Array& array) {
  sequence._maximum = sequence._length = static_cast<std::uint32_t>(array.size());
  sequence._buffer = array.data();
  sequence._release = false;
}

}  // namespace

builtin_interfaces_msg_dds__Time_ RosClock::time_of(std::uint64_t monotonic_ns) {
  const std::uint64_t now_ns = rtbus::monotonic_ns();
  if (looked_ns_ == 0 || now_ns > looked_ns_ + rtbus::kNsPerS) {
    // Between two looks at one clock lies the look at the other: at most half of that is the error. The closest of
    // three: an interruption in one would let the stamps jump.
    std::uint64_t closest_ns = ~std::uint64_t{0};
    for (int look = 0; look < 3; ++look) {
      const std::uint64_t before_ns = rtbus::monotonic_ns();
      const std::int64_t real_ns = realtime_ns();
      const std::uint64_t between_ns = rtbus::monotonic_ns() - before_ns;
      if (between_ns >= closest_ns) continue;
      closest_ns = between_ns;
      offset_ns_ = real_ns - static_cast<std::int64_t>(before_ns + between_ns / 2);
    }
    looked_ns_ = now_ns;
  }
  const std::int64_t time_ns = static_cast<std::int64_t>(monotonic_ns) + offset_ns_;
  const auto second = static_cast<std::int64_t>(rtbus::kNsPerS);
  return {static_cast<std::int32_t>(time_ns / second), static_cast<std::uint32_t>(time_ns % second)};
}

Header header_of(builtin_interfaces_msg_dds__Time_ stamp, const std::string& frame) { return {stamp, text(frame)}; }

PoseStamped pose_of(const Header& header, const rtbus::Vec3& p, const rtbus::Quat& q) {
  return {header, {{p[0], p[1], p[2]}, {q[1], q[2], q[3], q[0]}}};  // ROS 2 has w last
}

TwistStamped twist_of(const Header& header, const rtbus::Vec3& linear_m_s, const rtbus::Vec3& angular_rad_s) {
  return {header, {vector_of(linear_m_s), vector_of(angular_rad_s)}};
}

WrenchStamped wrench_of(const Header& header, const rtbus::Vec3& force_n) {
  return {header, {vector_of(force_n), {0.0, 0.0, 0.0}}};
}

const sensor_msgs_msg_dds__Joy_& Joy::fill(const Header& header, std::uint32_t buttons, double gripper_m) {
  for (std::size_t i = 0; i < buttons_.size(); ++i) buttons_[i] = static_cast<std::int32_t>((buttons >> i) & 1U);
  axes_[0] = static_cast<float>(gripper_m);
  message_.header = header;
  refer(message_.axes, axes_);
  refer(message_.buttons, buttons_);
  return message_;
}

const sensor_msgs_msg_dds__JointState_& JointState::fill(const Header& header, const rtbus::Vec3& position_m,
                                                         const rtbus::Vec3& velocity_m_s, const rtbus::Vec3& force_n) {
  for (std::size_t i = 0; i < names_.size(); ++i) name_pointers_[i] = text(names_[i]);
  position_ = position_m;
  velocity_ = velocity_m_s;
  effort_ = force_n;
  message_.header = header;
  refer(message_.name, name_pointers_);
  refer(message_.position, position_);
  refer(message_.velocity, velocity_);
  refer(message_.effort, effort_);
  return message_;
}

void Transforms::add(builtin_interfaces_msg_dds__Time_ stamp, std::string parent, std::string child,
                     const Eigen::Vector3d& p, const Eigen::Quaterniond& q) {
  rows_.push_back({stamp, std::move(parent), std::move(child), {{p.x(), p.y(), p.z()}, {q.x(), q.y(), q.z(), q.w()}}});
}

const tf2_msgs_msg_dds__TFMessage_& Transforms::message() {
  out_.clear();
  for (const Row& row : rows_) out_.push_back({header_of(row.stamp, row.parent), text(row.child), row.transform});
  refer(message_.transforms, out_);
  return message_;
}

const diagnostic_msgs_msg_dds__DiagnosticArray_& Diagnostics::fill(const Header& header, std::vector<Status> rows) {
  rows_ = std::move(rows);
  values_.assign(rows_.size(), {});
  out_.assign(rows_.size(), {});
  for (std::size_t i = 0; i < rows_.size(); ++i) {
    const Status& row = rows_[i];
    for (const auto& [key, value] : row.values) values_[i].push_back({text(key), text(value)});
    out_[i].level = static_cast<std::uint8_t>(row.level);
    out_[i].name = text(row.name);
    out_[i].message = text(row.message);
    out_[i].hardware_id = text(row.hardware);
    refer(out_[i].values, values_[i]);
  }
  message_.header = header;
  refer(message_.status, out_);
  return message_;
}

}  // namespace bridge
