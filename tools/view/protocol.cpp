#include "tools/view/protocol.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

namespace view {

namespace {

static_assert(std::endian::native == std::endian::little, "the messages are written as they lie in memory");

class Bytes {
 public:
  explicit Bytes(Message& message) : message_(message) {}

  template <class T>
  void add(T value) {
    const std::size_t at = message_.size();
    message_.resize(at + sizeof value);
    std::memcpy(message_.data() + at, &value, sizeof value);
  }
  void add_float(double value) { add(static_cast<float>(value)); }
  void add_floats(const Eigen::Vector3d& v) {
    for (const double x : v) add_float(x);
  }
  template <std::size_t N>
  void add_floats(const std::array<float, N>& v) {
    for (const float x : v) add(x);
  }

 private:
  Message& message_;
};

std::uint32_t u32(std::size_t value) { return static_cast<std::uint32_t>(value); }

std::int32_t micrometres(double length_m) {
  return static_cast<std::int32_t>(std::lround(std::clamp(1e6 * length_m, -2147483647.0, 2147483647.0)));
}

void add_tick(Bytes& bytes, const ViewTick& tick, double now_s) {
  bytes.add_float(tick.time_s - now_s);
  bytes.add_floats(tick.force_n);
  bytes.add_floats(tick.position_m);
  bytes.add_floats(tick.proxy_m);
  for (const float value :
       {tick.proxy_age_ms, tick.energy_mj, tick.wakeup_us, tick.compute_us, tick.step_ms, tick.gate}) {
    bytes.add(value);
  }
  bytes.add_float(static_cast<double>(tick.safety));  // exact below 2²⁴
}

}  // namespace

Message encode_frame(const ViewScene& scene, const ViewFrame& frame, double now_s, std::uint64_t sent,
                     FrameCursor& cursor) {
  const bool new_poses = frame.poses_number != cursor.poses;
  const std::size_t bodies = new_poses && frame.poses.size() == scene.order.size() ? frame.poses.size() : 0;
  const std::size_t nodes = new_poses && frame.soft_nodes_m.size() == scene.soft_nodes ? frame.soft_nodes_m.size() : 0;
  cursor.ticks.resize(frame.hands.size(), 0);

  std::vector<std::size_t> ticks;
  std::size_t size = kMessageRoom + kHeaderBytes + bodies * kBodyBytes + nodes * kNodeBytes +
                     frame.contacts.size() * kContactBytes + frame.hands.size() * kHandBytes;
  for (std::size_t i = 0; i < frame.hands.size(); ++i) {
    const ViewTicks& have = frame.hands[i].ticks;
    std::uint64_t& next = cursor.ticks[i];
    next = next > have.end() ? have.first : std::max(next, have.first);
    ticks.push_back(std::min<std::size_t>(have.end() - next, kTicksPerFrame));
    size += ticks.back() * kTickBytes;
  }

  Message message;
  message.reserve(size);
  message.resize(kMessageRoom);
  Bytes out(message);
  out.add(kFrameMagic);
  out.add(kProtocol);
  out.add(static_cast<std::uint16_t>(kHeaderBytes));
  out.add(sent);
  out.add(now_s);
  out.add(frame.poses_s);
  out.add(frame.simulated_s);
  out.add(scene.number);
  for (const std::size_t count : {bodies, nodes, frame.hands.size(), frame.contacts.size()}) out.add(u32(count));
  out.add(frame.jumps);
  for (std::size_t row = 0; row < bodies; ++row) {
    const physics::BodyPose& pose = frame.poses[scene.order[row]];
    out.add_floats(pose.position_m);
    for (const double q : {pose.orientation.w(), pose.orientation.x(), pose.orientation.y(), pose.orientation.z()}) {
      out.add_float(q);
    }
  }
  for (std::size_t i = 0; i < nodes; ++i) {
    for (const double x : frame.soft_nodes_m[i]) out.add(micrometres(x));
  }
  for (const ViewContact& contact : frame.contacts) {
    out.add_floats(contact.point_m);
    out.add_floats(contact.normal);
    out.add_float(contact.gap_m);
    out.add(contact.hand);
  }
  for (std::size_t i = 0; i < frame.hands.size(); ++i) {
    const ViewHand& hand = frame.hands[i];
    for (const Eigen::Vector3d& v : {hand.proxy_m, hand.device_m, hand.force_n, hand.origin_m}) out.add_floats(v);
    out.add_float(hand.radius_m);
    out.add(u32(ticks[i]));
    out.add(cursor.ticks[i]);  // number of the first of them
  }
  for (std::size_t i = 0; i < frame.hands.size(); ++i) {
    const ViewTicks& have = frame.hands[i].ticks;
    const std::size_t from = cursor.ticks[i] - have.first;
    for (std::size_t k = 0; k < ticks[i]; ++k) add_tick(out, have.rows[from + k], now_s);
    cursor.ticks[i] += ticks[i];
  }
  cursor.number = frame.number;
  cursor.poses = frame.poses_number;
  return message;
}

Message encode_mesh(const ViewScene& scene, std::size_t index) {
  const rtbus::config::TriangleMesh& mesh = *scene.meshes[index];
  Message message;
  message.reserve(kMessageRoom + 20 + 12 * (mesh.vertices_m.size() + mesh.triangles.size()));
  message.resize(kMessageRoom);
  Bytes out(message);
  out.add(kMeshMagic);
  for (const std::size_t value : {std::size_t{scene.number}, index, mesh.vertices_m.size(), mesh.triangles.size()}) {
    out.add(u32(value));
  }
  for (const Eigen::Vector3d& vertex : mesh.vertices_m) out.add_floats(vertex);
  for (const auto& triangle : mesh.triangles) {
    for (const std::uint32_t corner : triangle) out.add(corner);
  }
  return message;
}

}  // namespace view
