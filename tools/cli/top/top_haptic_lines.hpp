#pragma once
/// @file top_haptic_lines.hpp
/// The parts of a haptic node's lines; top_node_lines.hpp puts them in order. Each adds nothing when what it shows is
/// not known.
#include <string>

#include "tools/cli/top/top_node_lines.hpp"

namespace tools {

/// "FIFO, core 1": what the scheduler granted.
[[nodiscard]] std::string granted_text(const rtbus::NodeInfo& info);

class HapticLines {
 public:
  /// Refers to its arguments.
  HapticLines(const HapticView& view, Detail detail, const LineStyle& style)
      : view_(view), detail_(detail), style_(style) {}

  void add_granted(Lines& lines) const;
  void add_rate(Lines& lines) const;
  void add_wakeup(Lines& lines) const;
  void add_jitter(Lines& lines) const;
  void add_compute(Lines& lines) const;  ///< With the proxy age.
  void add_force(Lines& lines) const;
  void add_force_curve(Lines& lines) const;
  void add_position(Lines& lines) const;
  void add_position_curves(Lines& lines) const;
  void add_energy(Lines& lines) const;
  void add_safety(Lines& lines) const;
  void add_link(Lines& lines) const;  ///< Of a device over USB.
  void add_cut(Lines& lines) const;

 private:
  /// Columns for drawings after a margin of twelve and `beside` cells of text.
  [[nodiscard]] std::size_t columns(int beside) const;

  const HapticView& view_;
  Detail detail_;
  const LineStyle& style_;
};

}  // namespace tools
