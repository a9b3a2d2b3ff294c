#include "drivers/haply/line.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "drivers/haply/http_get.hpp"
#include "rtbus/clock.hpp"

namespace drivers::haply {
namespace {

using io::ExchangeStatus;
using io::SendStatus;
using rtbus::Failure;

constexpr double kNoticeable_n = 0.05;
/// So many answers in a row without the force that was sent: the service does not understand it.
constexpr int kUnheardAnswers = 30;
/// So many answers in a row with more force than was sent: somebody else commands the device too.
constexpr int kExcessAnswers = 50;
constexpr double kExcess_n = 0.3, kExcessShare = 0.25;
/// From this release on the force is named `vector`.
constexpr Version kVectorSince{3, 5};
constexpr Version kOldest{3, 1};
constexpr double kFarthest_m = 1.0;

double norm(const Vec3& v) { return std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]); }

template <class List>
std::string joined(const List& list) {
  std::string out;
  for (const auto& each : list) out += (out.empty() ? "" : ", ") + each;
  return out;
}

}  // namespace

rtbus::Result<void, DeviceFault> HaplyLine::choose(const Inventory& inventory) {
  std::vector<std::string> ids;
  for (const auto& each : inventory.inverses) ids.push_back(each.id);
  if (ids.empty()) {
    return Failure{
        DeviceFault{"the Inverse Service knows no Inverse3; connect it by USB without a hub, connect its 24 V "
                    "supply, close programs that use it directly"}};
  }
  if (settings_.device.empty() && ids.size() > 1) {
    return Failure{DeviceFault{"there are several: " + joined(ids) + "; name one by `device_id:`"}};
  }
  device_ = settings_.device.empty() ? ids.front() : settings_.device;
  if (std::find(ids.begin(), ids.end(), device_) == ids.end()) {
    return Failure{DeviceFault{"no Inverse3 has the id " + device_ + "; there is: " + joined(ids)}};
  }
  grip_.clear();
  for (const std::string& kind_and_id : inventory.grips) {
    const std::size_t colon = kind_and_id.find(':');
    const std::string id = kind_and_id.substr(colon + 1);
    if (!grip_.empty() || (!settings_.grip.empty() && id != settings_.grip)) continue;
    grip_ = id;
    grip_kind_ = kind_and_id.substr(0, colon);
  }
  if (!settings_.grip.empty() && grip_.empty()) {
    return Failure{DeviceFault{"no VerseGrip has the id " + settings_.grip +
                               "; there is: " + (inventory.grips.empty() ? "none" : joined(inventory.grips)) +
                               "; press a button of it to wake it, pair it in Haply Hub"}};
  }
  if (!inventory.not_neutral.empty()) {
    news_ = "settings of the service change the force that is felt: " + joined(inventory.not_neutral) +
            "; reset them in Haply Hub";
  }
  return {};
}

// The list of devices that the service sends unasked.
rtbus::Result<void, DeviceFault> HaplyLine::greet(const std::string& where, const io::StopFlag& stop) {
  std::string_view text;
  if (socket_.receive_first(text, stop) != WireStatus::kOk) {
    return Failure{DeviceFault{"the Inverse Service at " + where + " sends no list of devices" + socket_.why_closed() +
                               "; restart it"}};
  }
  const auto inventory = read_inventory(text);
  if (!inventory) return Failure{DeviceFault{inventory.error()}};
  if (auto chosen = choose(*inventory); !chosen) return chosen;
  return claim(where);
}

// The service adds up the forces of all its clients: it would not refuse the second one.
rtbus::Result<void, DeviceFault> HaplyLine::claim(const std::string& where) {
  claims_.clear();
  for (const std::string& device : {settings_.claim, "haply " + where + " " + device_}) {
    if (device.empty()) continue;
    auto taken = vendor::Claim::take(device, settings_.owner);
    if (!taken) {
      claims_.clear();
      return Failure{DeviceFault{taken.error() + " has the Inverse3 " + device_ +
                                 "; end that session, or choose another device by `device_id:`"}};
    }
    claims_.push_back(std::move(*taken));
  }
  return {};
}

rtbus::Result<void, DeviceFault> HaplyLine::connect(io::StopFlag& stop) {
  const Settings::Ports ports =
      settings_.prepare ? settings_.prepare() : Settings::Ports{settings_.port, settings_.events_port};
  const std::string where = settings_.address + ":" + std::to_string(ports.port);
  if (const std::string problem = socket_.connect(settings_.address, ports.port, stop); !problem.empty()) {
    return Failure{
        DeviceFault{"the Inverse Service at " + where + ": " + problem +
                    "; start it with `sudo systemctl start haply-inverse-service`, install it from Haply, or "
                    "correct `port:`"}};
  }
  if (auto chosen = greet(where, stop); !chosen) {
    socket_.close();
    return chosen;
  }
  const auto version =
      read_version(http_get(settings_.address, ports.port, "/version", rtbus::monotonic_ns() + rtbus::kNsPerS, stop));
  if (version && *version < kOldest) {
    disconnect(false);
    return Failure{DeviceFault{"the Inverse Service at " + where + " has version " + std::to_string(version->major) +
                               "." + std::to_string(version->minor) + "; install version 3.1 or later"}};
  }
  if (ports.events_port != 0) socket_.follow_events(settings_.address, ports.events_port, stop);
  const bool vector =
      settings_.field == "vector" || (settings_.field == "auto" && (!version || *version >= kVectorSince));
  field_ = vector ? ForceField::kVector : ForceField::kValues;
  both_tried_ = settings_.field != "auto";
  field_confirmed_ = false;
  first_ = true;
  behind_ = false;
  unheard_ = excess_ = 0;
  fault_.clear();
  sent_n_ = sent_before_n_ = {};
  readiness_ = io::Readiness::kReady;
  return {};
}

void HaplyLine::disconnect(bool reachable) noexcept {
  if (reachable && !device_.empty()) {
    DeviceSample sample;
    const std::uint64_t deadline_ns = rtbus::monotonic_ns() + 20 * rtbus::kNsPerMs;
    if (send({}, 0.001, false, deadline_ns) == SendStatus::kSent) (void)receive(sample, deadline_ns);
  }
  socket_.close();
  claims_.clear();
}

SendStatus HaplyLine::send(const Vec3& asked_n, double, bool, std::uint64_t deadline_ns) noexcept {
  const bool ready = readiness_ == io::Readiness::kReady;
  const bool hold = !ready || std::exchange(withhold_next_, false);
  withheld_ = hold && asked_n != Vec3{};
  if (behind_ && socket_.discard() > 0) behind_ = false;
  sent_before_n_ = sent_n_;
  sent_n_ = to_service(hold ? Vec3{} : asked_n);
  write_command(message_, std::exchange(first_, false), device_, grip_, grip_kind_, field_, sent_n_);
  switch (socket_.send(message_, deadline_ns)) {
    case WireStatus::kOk:
      return SendStatus::kSent;
    case WireStatus::kTimeout:
      return SendStatus::kNothing;
    case WireStatus::kClosed:
      break;
  }
  return SendStatus::kLost;
}

// A force in a field that this release does not know is no error to the service, and no force.
void HaplyLine::check_echo(const ServiceState& state) {
  if (norm(sent_n_) < kNoticeable_n) return;
  if (norm(state.force_n) > 0.01 * norm(sent_n_)) {
    unheard_ = 0;
    field_confirmed_ = true;
    return;
  }
  if (++unheard_ < kUnheardAnswers) return;
  unheard_ = 0;
  withhold_next_ = true;  // what comes then must begin with a ramp
  if (!field_confirmed_ && !both_tried_) {
    both_tried_ = true;
    field_ = field_ == ForceField::kVector ? ForceField::kValues : ForceField::kVector;
    return;
  }
  fault_ =
      "the service renders none of the forces that it is told: is the device without its 24 V supply, or "
      "force_scale 0? Or set force_field: values, or vector";
}

// The forces of all programs add up in the service. What it renders may be that of the message before.
void HaplyLine::check_excess(const ServiceState& state) {
  const double told_n = std::max(norm(sent_n_), norm(sent_before_n_));
  if (norm(state.force_n) <= (1.0 + kExcessShare) * told_n + kExcess_n) {
    excess_ = 0;
    return;
  }
  if (++excess_ < kExcessAnswers) return;
  excess_ = 0;
  withhold_next_ = true;
  fault_ =
      "the service renders more force than it is told: another program commands the device too; close it, or reset "
      "force_scale in Haply Hub";
}

void HaplyLine::show_events() {
  for (std::string text = socket_.take_event(); !text.empty(); text = socket_.take_event()) {
    const std::string said = read_event(text);
    if (!said.empty()) news_ += (news_.empty() ? "" : "; ") + said;
  }
}

// False: it cannot go on so.
bool HaplyLine::look_at(const ServiceState& state) {
  if (!state.calibrated) {
    readiness_ = io::Readiness::kNotHomed;
    remedy_ =
        "it is not calibrated: touch the mark on its body with the magnet of its gimbal (magenta light: not "
        "calibrated, white: done)";
    return true;
  }
  readiness_ = io::Readiness::kReady;
  check_echo(state);
  check_excess(state);
  return fault_.empty();
}

ExchangeStatus HaplyLine::receive(DeviceSample& out, std::uint64_t deadline_ns) noexcept {
  std::string_view text;
  switch (socket_.receive(text, deadline_ns)) {
    case WireStatus::kOk:
      break;
    case WireStatus::kTimeout:
      ++counters_.lost_frames;
      behind_ = true;
      return ExchangeStatus::kNothing;
    case WireStatus::kClosed:
      fault_ = "the Inverse Service has closed the connection" + socket_.why_closed();
      return ExchangeStatus::kFault;
  }
  const std::uint64_t now_ns = rtbus::monotonic_ns();
  show_events();
  const auto read = read_state(text, device_, grip_);
  if (!read) {
    ++counters_.bad_frames;
    return ExchangeStatus::kNothing;
  }
  if (!*read) return ExchangeStatus::kLost;  // the service goes on without the device
  const ServiceState& state = **read;
  for (const double p : state.position_m) {
    if (std::isfinite(p) && std::abs(p) < kFarthest_m) continue;
    ++counters_.bad_frames;
    return ExchangeStatus::kNothing;
  }
  if (!look_at(state)) return ExchangeStatus::kFault;
  Vec3 p = state.position_m;
  for (std::size_t i = 0; i < 3; ++i) p[i] -= settings_.origin_m[i];
  out.position_m = from_service(p);
  out.velocity_m_s = from_service(state.velocity_m_s);
  if (state.grip_wxyz) grip_wxyz_ = from_service(*state.grip_wxyz);  // asleep: the last one
  out.orientation_wxyz = grip_wxyz_;
  out.buttons = state.buttons;
  out.time_ns = now_ns;
  ++counters_.exchanges;
  return ExchangeStatus::kSample;
}

}  // namespace drivers::haply
