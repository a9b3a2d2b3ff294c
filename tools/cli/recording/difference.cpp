#include "tools/cli/recording/difference.hpp"

#include <algorithm>
#include <cmath>

namespace tools {
namespace {

constexpr double kLongestGap_s = 0.05;
constexpr double kJumpWindow_s = 1e-3;
constexpr double kJitter = 1.5;  ///< Two samples of 1 kHz may be so many windows apart.

double norm(const double* row, std::size_t elements) {
  double sum = 0.0;
  for (std::size_t i = 0; i < elements; ++i) sum += row[i] * row[i];
  return std::sqrt(sum);
}

double distance(const double* a, const double* b, std::size_t elements) {
  double sum = 0.0;
  for (std::size_t i = 0; i < elements; ++i) sum += (a[i] - b[i]) * (a[i] - b[i]);
  return std::sqrt(sum);
}

/// Largest change of the difference within the window. A longer step between two samples counts per millisecond.
void find_jump(Difference& out, std::size_t elements) {
  std::size_t from = 0;
  for (std::size_t k = 1; k < out.time_s.size(); ++k) {
    while (from + 1 < k && out.time_s[k] - out.time_s[from] > kJitter * kJumpWindow_s) ++from;
    for (std::size_t j = from; j < k; ++j) {
      const double step_s = out.time_s[k] - out.time_s[j];
      if (step_s > kLongestGap_s) continue;
      const double change = distance(&out.value[k * elements], &out.value[j * elements], elements) /
                            std::max(1.0, step_s / kJumpWindow_s);
      if (change > out.jump_per_ms) out.jump_per_ms = change, out.jump_s = out.time_s[k];
    }
  }
}

}  // namespace

Difference compare(const Track& reference, const Track& b) {
  Difference out;
  const std::size_t elements = std::min(reference.elements, b.elements);
  if (b.time_s.empty() || elements == 0) return out;
  double squares = 0.0, reference_squares = 0.0;
  std::size_t next = 0;  // the first sample of B after the time
  for (std::size_t k = 0; k < reference.time_s.size(); ++k) {
    const double t_s = reference.time_s[k];
    while (next < b.time_s.size() && b.time_s[next] < t_s) ++next;
    if (next == b.time_s.size()) break;
    const bool exact = b.time_s[next] == t_s;
    if (next == 0 && !exact) continue;
    const std::size_t before = exact ? next : next - 1;
    const double step_s = b.time_s[next] - b.time_s[before];
    if (step_s > kLongestGap_s) continue;
    const double share = step_s > 0.0 ? (t_s - b.time_s[before]) / step_s : 0.0;
    const double* const own = &reference.value[k * reference.elements];
    for (std::size_t i = 0; i < elements; ++i) {
      const double left = b.value[before * b.elements + i], right = b.value[next * b.elements + i];
      out.value.push_back(left + share * (right - left) - own[i]);
    }
    out.time_s.push_back(t_s);
    const double size = norm(&out.value[out.value.size() - elements], elements), own_size = norm(own, elements);
    squares += size * size;
    reference_squares += own_size * own_size;
    if (size > out.peak || out.samples == 0) out.peak = size, out.peak_s = t_s;
    out.reference_peak = std::max(out.reference_peak, own_size);
    ++out.samples;
  }
  if (out.samples == 0) return out;
  out.from_s = out.time_s.front();
  out.to_s = out.time_s.back();
  out.rms = std::sqrt(squares / static_cast<double>(out.samples));
  out.reference_rms = std::sqrt(reference_squares / static_cast<double>(out.samples));
  find_jump(out, elements);
  return out;
}

}  // namespace tools
