#pragma once
/// @file signals.hpp
/// Signals of a recording or of a running session by short names: "force_n" (all its elements), "force_n[1]",
/// "telemetry.force_n[1]".
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "rtbus/recording/reader.hpp"
#include "rtbus/result.hpp"
#include "tools/cli/common/choose.hpp"

namespace tools {

/// One number over time.
struct Signal {
  std::string topic, field;
  std::uint32_t element = 0;
  std::uint32_t elements = 1;  ///< Of its field.
  std::string unit;
  std::size_t recording = 0;   ///< Which of several.
  std::vector<double> time_s;  ///< Since the start of the recording, or a common origin.
  std::vector<double> value;

  /// "haptic0.telemetry force_n x" for a vector of three, "… [4]" otherwise.
  [[nodiscard]] std::string label(bool with_topic) const;
};

/// What a topic offers, wherever it comes from.
struct SignalSource {
  std::string topic;
  std::vector<rtbus::Segment::OwnedField> fields;
};

/// Which (topic, field, element) `wanted` means. Where several topics have the field, the haptic node's telemetry comes
/// first; "haptic1.telemetry.force_n" names one. Text fields are no signals. An unknown name is refused with the
/// nearest.
[[nodiscard]] rtbus::Result<std::vector<Signal>, Refusal> choose_signals(const std::vector<SignalSource>& sources,
                                                                         const std::vector<std::string>& wanted);

/// What a recording offers.
[[nodiscard]] std::vector<SignalSource> sources_of(const rtbus::recording::Recording& recording);

/// Where several recordings have their time 0 when they are laid over each other: the first tick of the first haptic
/// node (where a replay of it begins), or the first mark with the text `mark`. [ns, CLOCK_MONOTONIC]
[[nodiscard]] rtbus::Result<std::uint64_t, Refusal> common_origin_ns(const rtbus::recording::Recording& recording,
                                                                     const std::optional<std::string>& mark);

/// Of a force along z the other axes are zero throughout. Elements that are zero in each recording are left out, as
/// long as something of their field is not.
void leave_out_silent_elements(std::vector<Signal>& signals);

/// Fills in the values between two times [s since `origin_ns`].
void load_signals(const rtbus::recording::Recording& recording, double from_s, double to_s,
                  std::vector<Signal>& signals, std::uint64_t origin_ns);

/// Fills in the values of the next `duration_s` seconds of a running session. Ends early at Ctrl-C.
[[nodiscard]] rtbus::Result<void, Refusal> watch_signals(const rtbus::Session& session, double duration_s,
                                                         std::vector<Signal>& signals);

/// At most about `points` rows, keeping the least and the greatest value of each stretch: nothing that a figure could
/// show is lost.
void thin(Signal& signal, std::size_t points);

}  // namespace tools
