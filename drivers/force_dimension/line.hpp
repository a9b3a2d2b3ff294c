#pragma once
/// @file line.hpp
/// One device of Force Dimension, reached through the user's own copy of the maker's SDK. Each call blocks 0.1 to 1 ms;
/// all of them are made by the I/O thread, since the SDK keeps its last error per thread.
#include <cstdint>
#include <functional>
#include <string>

#include "drivers/force_dimension/models.hpp"
#include "drivers/force_dimension/sdk.hpp"
#include "drivers/io/line.hpp"
#include "drivers/vendor/claim.hpp"

namespace drivers::force_dimension {

struct Settings {
  Model model;
  std::string library;     ///< Empty: the usual places.
  int serial = 0;          ///< 0: the only one.
  bool auto_init = false;  ///< The user agreed that the arm moves by itself to calibrate.
  bool gravity_compensation = true;
  bool read_velocity = false;  ///< One more call in each exchange.
  double watchdog_s = 0.020;   ///< The controller turns forces off after so long without a command [s].
  std::string claim;           ///< What other sessions claim who mean the same device; empty: nobody does.
  std::string owner;           ///< Whom they are told.
  Vec3 origin_m{};             ///< Of D in the maker's frame, its axes [m].
  /// Called before the library is used: a stand-in's unit is plugged in. Returns a sentence when that fails.
  std::function<std::string()> prepare;
};

class FdLine final : public io::Line {
 public:
  explicit FdLine(Settings settings) : settings_(std::move(settings)) {}
  ~FdLine() override { FdLine::disconnect(true); }

  [[nodiscard]] rtbus::Result<void, DeviceFault> connect(io::StopFlag& stop) override;
  [[nodiscard]] io::SendStatus send(const Vec3& force_n, double dt_s, bool live,
                                    std::uint64_t deadline_ns) noexcept override;
  [[nodiscard]] bool withheld() const noexcept override { return withheld_; }
  [[nodiscard]] io::ExchangeStatus receive(DeviceSample& out, std::uint64_t deadline_ns) noexcept override;
  void disconnect(bool reachable) noexcept override;

  [[nodiscard]] io::Readiness readiness() const noexcept override { return readiness_; }
  [[nodiscard]] std::string remedy() const override { return remedy_; }
  [[nodiscard]] std::string fault() const override { return fault_; }
  [[nodiscard]] std::string take_news() override { return std::exchange(news_, {}); }
  [[nodiscard]] const io::LinkCounters& counters() const noexcept override { return counters_; }

 private:
  using Opened = rtbus::Result<void, DeviceFault>;
  [[nodiscard]] Opened claim();
  [[nodiscard]] Opened load();
  [[nodiscard]] Opened open();
  [[nodiscard]] Opened identify();
  [[nodiscard]] Opened calibrate();
  [[nodiscard]] Opened prepare_forces();
  [[nodiscard]] std::string others() const;
  [[nodiscard]] Opened failed(const std::string& what) const;
  void look_at_status(std::uint64_t now_ns);
  void read_velocity() noexcept;
  void read_gripper() noexcept;
  [[nodiscard]] io::SendStatus after_error() noexcept;

  Settings settings_;
  Sdk sdk_;
  vendor::Claim claim_;
  bool loaded_ = false;
  bool connected_before_ = false;  ///< The arm must not move by itself any more: a hand may be on it.
  char id_ = -1;
  bool open_ = false;
  io::Readiness readiness_ = io::Readiness::kReady;
  bool withheld_ = false;
  std::uint32_t buttons_ = 0;
  Vec3 velocity_m_s_{};  ///< The maker's frame.
  double gripper_m_ = 0.0;
  std::uint64_t exchanges_ = 0;
  std::uint64_t force_off_since_ns_ = 0;
  std::string remedy_, fault_, news_;
  io::LinkCounters counters_;
};

}  // namespace drivers::force_dimension
