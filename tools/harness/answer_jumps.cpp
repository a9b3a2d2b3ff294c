#include "tools/harness/answer_jumps.hpp"

#include <algorithm>

#include "rtbus/eigen.hpp"

namespace tools {

using rtbus::vector_of;

AnswerJumps::AnswerJumps(const haptic::HapticConfig& config)
    : mapping_(config.mapping),
      method_(config.stiffness_n_per_m, config.damping_n_s_per_m, mapping_, config.known),
      dt_s_(static_cast<double>(config.period_ns()) * 1e-9) {}

double AnswerJumps::see(const rtbus::Telemetry& tick) {
  haptic::RenderInput input;
  input.sample_time_ns = tick.device_time_ns;
  input.dt_s = dt_s_;
  input.position_m = vector_of(tick.position_m);
  input.velocity_m_s = vector_of(tick.velocity_m_s);
  input.proxy.valid = tick.proxy_sequence != 0;
  rtbus::ProxyContacts answer;
  if (tick.proxy_sequence != taken_) {
    const std::uint64_t answered_ns = tick.due_ns - tick.proxy_age_ns;
    // Its contacts belong to that sample, or to a little before (Stepper::contacts()).
    while (under_way_.size() > 1 && under_way_[1].device_time_ns <= answered_ns) under_way_.pop_front();
    if (!under_way_.empty() && under_way_.front().device_time_ns <= answered_ns) {
      answer = under_way_.front();
      under_way_.pop_front();
      input.contacts = &answer;
    }
    taken_ = tick.proxy_sequence;
  }
  const bool begins = input.contacts != nullptr;
  if (begins) {
    without_ = std::make_unique<haptic::LocalContact>(method_);
    follows_ = kFollowed;
    apart_n_.setZero();
  }
  const Eigen::Vector3d with_n = method_.render(input).force_n;
  others_ += with_n == vector_of(tick.rendered_force_n) ? 0 : 1;
  method_.felt(vector_of(tick.force_n));
  if (follows_ == 0) return 0.0;
  --follows_;
  input.contacts = nullptr;
  const Eigen::Vector3d without_n = without_->render(input).force_n;
  without_->felt(without_n + vector_of(tick.force_n) - with_n);  // what the safety ladder takes off, it takes off both
  const Eigen::Vector3d apart_n = with_n - without_n;
  const double change_n = (apart_n - apart_n_).norm();
  apart_n_ = apart_n;
  fastest_n_ = std::max(fastest_n_, change_n);
  if (!begins) return 0.0;
  if (!with_n.isZero(0.0) || !without_n.isZero(0.0)) changes_n_.push_back(change_n);
  return change_n;
}

double AnswerJumps::largest_n() const noexcept {
  return changes_n_.empty() ? 0.0 : *std::max_element(changes_n_.begin(), changes_n_.end());
}

}  // namespace tools
