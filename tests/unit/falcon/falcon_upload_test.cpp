// Bringing a virtual Falcon to life: the firmware goes up on the first try, bad handshakes are survived, and each way
// to fail has its own words.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "tests/support/temporary_file.hpp"
#include "tests/unit/falcon/virtual_bench.hpp"

namespace drivers::falcon {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
using tests::FalconBench;
using virtual_usb::FalconState;
using virtual_usb::VirtualFalconSettings;

double seconds(const FalconBench& bench) { return static_cast<double>(bench.channel.now_ns()) * 1e-9 - 1.0; }

VirtualFalconSettings with(const std::function<void(virtual_usb::Faults&)>& set, std::uint64_t seed = 1) {
  VirtualFalconSettings settings;
  set(settings.board.faults);
  settings.board.seed = seed;
  return settings;
}

TEST(FalconUpload, SucceedsAtTheFirstTryOnAHealthyDevice) {
  FalconBench bench;
  EXPECT_EQ(bench.bring_up(), "");
  EXPECT_EQ(bench.protocol->upload().attempts, 1);
  EXPECT_EQ(bench.device.board().uploads(), 1);
  EXPECT_EQ(bench.device.board().state(), FalconState::kRunning);
  EXPECT_LT(seconds(bench), 2.0);
  EXPECT_EQ(bench.device.latency_ms(), 1);
  EXPECT_EQ(bench.device.baud().value, 2);
}

TEST(FalconUpload, SendsTheDocumentedRequestsInOrder) {
  FalconSettings settings;
  settings.never_probe = true;
  FalconBench bench({}, settings);
  EXPECT_EQ(bench.bring_up(), "");
  std::vector<std::pair<int, int>> seen;
  for (const usb::Setup& setup : bench.device.requests()) {
    EXPECT_EQ(setup.request_type, 0x40);
    seen.emplace_back(setup.request, setup.value);
  }
  const std::vector<std::pair<int, int>> expected{
      {0, 1},     {0, 2}, {4, 8},     {2, 0},      {9, 1}, {6, 0x3E}, {3, 2}, {0, 1},     {0, 2},  // exchange
      {0, 1},     {0, 2}, {9, 16},    {3, 0x4138}, {4, 8}, {2, 0},    {6, 0}, {1, 0x200}, {1, 0x100},
      {1, 0x101},                                                                                   // handshake
      {0, 1},     {0, 2}, {1, 0x100}, {3, 0x15},                                                    // boot ROM
      {0, 1},     {0, 2}, {4, 8},     {2, 0},      {9, 1}, {6, 0x3E}, {3, 2}, {0, 1},     {0, 2}};  // exchange
  EXPECT_EQ(seen, expected);
}

TEST(FalconUpload, FindsRunningFirmwareAndLeavesIt) {
  FalconBench bench;
  ASSERT_EQ(bench.bring_up(), "");
  ASSERT_GT(bench.home(), 0.0);
  FalconProtocol again{FalconSettings{}};
  const auto result = again.bring_up(bench.channel);
  EXPECT_TRUE(result) << result.error().message;
  EXPECT_EQ(again.upload().attempts, 0);
  EXPECT_EQ(bench.device.board().uploads(), 1);
}

TEST(FalconUpload, StateSurvivesDetachAndReattach) {
  FalconBench bench;
  ASSERT_EQ(bench.bring_up(), "");
  ASSERT_GT(bench.home(), 0.0);
  bench.channel.unplug_at(bench.channel.now_ns());
  EXPECT_FALSE(bench.run(0.1));
  virtual_usb::VirtualChannel plugged_anew(
      bench.device, {.start_ns = bench.channel.now_ns() + 500'000'000, .interfaces = {0}, .faults = {}});
  const auto result = bench.protocol->bring_up(plugged_anew);
  ASSERT_TRUE(result) << result.error().message;
  DeviceSample sample;
  ASSERT_EQ(bench.protocol->send(plugged_anew, {}, 0.001, virtual_usb::kNever), usb::UsbStatus::kOk);
  ASSERT_EQ(bench.protocol->receive(plugged_anew, sample, virtual_usb::kNever), usb::ExchangeStatus::kSample);
  EXPECT_EQ(bench.protocol->readiness(), usb::Readiness::kReady);
  EXPECT_EQ(bench.device.board().uploads(), 1);
}

TEST(FalconUpload, APowerCycleNeedsFirmwareAndHomingAnew) {
  FalconBench bench;
  ASSERT_EQ(bench.bring_up(), "");
  ASSERT_GT(bench.home(), 0.0);
  bench.device.power_cycle(bench.channel.now_ns());
  EXPECT_EQ(bench.exchange({}), usb::ExchangeStatus::kNothing);
  EXPECT_EQ(bench.bring_up(), "");
  EXPECT_EQ(bench.device.board().uploads(), 2);
  EXPECT_EQ(bench.protocol->readiness(), usb::Readiness::kNotHomed);
  EXPECT_GT(bench.home(), 0.0);
}

TEST(FalconUpload, ForcedOnceAndNotAtEveryReplug) {
  FalconSettings settings;
  settings.force_upload = true;
  FalconBench bench({}, settings);
  ASSERT_EQ(bench.bring_up(), "");
  ASSERT_EQ(bench.bring_up(), "");
  EXPECT_EQ(bench.device.board().uploads(), 1);
}

TEST(FalconUpload, ThreeTriesAreEnoughWhenThreeInTenHandshakesFail) {
  int retried = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    FalconBench bench(with([](auto& faults) { faults.fail_handshake = 0.3; }, seed));
    ASSERT_EQ(bench.bring_up(), "") << "seed " << seed;
    EXPECT_LE(bench.protocol->upload().attempts, 3) << "seed " << seed;
    if (bench.protocol->upload().attempts > 1) ++retried;
  }
  EXPECT_GE(retried, 2);  // else nothing was injected
}

TEST(FalconUpload, SaysWithinFiveSecondsThatThereIsNoPower) {
  FalconBench bench(with([](auto& faults) { faults.mute = true; }));
  EXPECT_THAT(bench.bring_up(), HasSubstr("is its wall power connected?"));
  EXPECT_LT(seconds(bench), 5.0);
}

TEST(FalconUpload, TellsAMissingFirmwareFileFromMissingPower) {
  FalconSettings settings;
  settings.firmware = std::make_shared<const FirmwareImage>();
  FalconBench alive({}, settings);
  EXPECT_THAT(alive.bring_up(), HasSubstr("set firmware:"));
  FalconBench dead(with([](auto& faults) { faults.mute = true; }), settings);
  EXPECT_THAT(dead.bring_up(), HasSubstr("wall power"));
  EXPECT_LT(seconds(dead), 5.0);
}

TEST(FalconUpload, NamesTheByteWhoseEchoIsWrong) {
  FalconSettings settings;
  settings.patience.attempts = 3;
  FalconBench bench(with([](auto& faults) { faults.flip_echo_bit = 0.01; }), settings);
  const std::string message = bench.bring_up();
  EXPECT_THAT(message, HasSubstr("after 3 attempts, the echo of byte"));
  EXPECT_THAT(message, HasSubstr("check the USB cable"));
}

TEST(FalconUpload, AFewWrongEchoesAreSurvived) {
  int retried = 0;
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    FalconBench bench(with([](auto& faults) { faults.flip_echo_bit = 1e-4; }, seed));
    ASSERT_EQ(bench.bring_up(), "") << "seed " << seed;
    if (bench.protocol->upload().attempts > 1) ++retried;
  }
  EXPECT_GE(retried, 1);
}

// Goes dead at a chosen moment of the upload, or answers with something else.
class Spoiler final : public virtual_usb::UsbDevice {
 public:
  explicit Spoiler(virtual_usb::VirtualFalcon& device) : device_(device) {}
  const virtual_usb::Descriptors& descriptors() const noexcept override { return device_.descriptors(); }
  virtual_usb::PacketReply control(const usb::Setup& setup, std::span<const std::uint8_t> data, std::uint16_t length,
                                   std::uint64_t now_ns) override {
    if (refuse_control) return {virtual_usb::Reply::kStall, {}, 0};
    return device_.control(setup, data, length, now_ns);
  }
  virtual_usb::PacketReply out_packet(std::uint8_t endpoint, std::span<const std::uint8_t> bytes,
                                      std::uint64_t now_ns) override {
    if (device_.board().state() == deaf_in) return {};
    if (device_.board().state() == FalconState::kLoader) stream_packets = 0;
    if (device_.board().state() == FalconState::kStream && stream_packets++ >= dead_after_packets) return {};
    return device_.out_packet(endpoint, bytes, now_ns);
  }
  virtual_usb::PacketReply in_packet(std::uint8_t endpoint, std::uint64_t now_ns) override {
    auto reply = device_.in_packet(endpoint, now_ns);
    if (babble && reply.reply == virtual_usb::Reply::kAck) reply.bytes.push_back(0x55);
    return reply;
  }
  void bus_reset(std::uint64_t now_ns) override { device_.bus_reset(now_ns); }

  FalconState deaf_in = FalconState::kStuck;
  int dead_after_packets = 1'000'000;
  int stream_packets = 0;
  bool refuse_control = false;
  bool babble = false;

 private:
  virtual_usb::VirtualFalcon& device_;
};

std::string spoiled_by(const std::function<void(Spoiler&)>& set, bool known = true) {
  virtual_usb::VirtualFalcon device{{}};
  Spoiler spoiler(device);
  virtual_usb::VirtualChannel channel(spoiler);
  set(spoiler);
  FalconSettings settings;
  settings.patience.attempts = 2;
  settings.firmware = FalconBench::synthetic(known ? "known" : "");
  FalconProtocol protocol(settings);
  const auto result = protocol.bring_up(channel);
  return result ? "" : result.error().message;
}

TEST(FalconUpload, EveryStageHasItsOwnReason) {
  EXPECT_EQ(spoiled_by([](Spoiler&) {}), "");
  EXPECT_THAT(spoiled_by([](Spoiler& s) { s.refuse_control = true; }), HasSubstr("refuses the line settings"));
  EXPECT_THAT(spoiled_by([](Spoiler& s) { s.babble = true; }), HasSubstr("it answers at 9600 baud, but not with"));
  EXPECT_THAT(spoiled_by([](Spoiler& s) { s.deaf_in = FalconState::kAutoBaud; }),
              HasSubstr("its boot loader does not lock to 140351 baud"));
  EXPECT_THAT(spoiled_by([](Spoiler& s) { s.dead_after_packets = 10; }), HasSubstr("the echo stops after 620 bytes"));
  EXPECT_THAT(spoiled_by([](Spoiler& s) { s.deaf_in = FalconState::kRunning; }), HasSubstr("but does not run it"));
  EXPECT_THAT(spoiled_by([](Spoiler& s) { s.deaf_in = FalconState::kRunning; }, false),
              HasSubstr("mine.bin is none of the known files"));
}

TEST(FalconUpload, IsEndedByUnpluggingAndByStoppingAtAnyMoment) {
  FalconBench whole;
  ASSERT_EQ(whole.bring_up(), "");
  const double whole_s = seconds(whole);
  ASSERT_GT(whole_s, 0.5);
  for (double at_s = 0.0; at_s < whole_s; at_s += 0.0131) {
    const auto at_ns = 1'000'000'000 + static_cast<std::uint64_t>(at_s * 1e9);
    FalconBench unplugged;
    unplugged.channel.unplug_at(at_ns);
    EXPECT_EQ(unplugged.bring_up(), "the Falcon was unplugged") << at_s;
    FalconBench stopped;
    stopped.channel.stop_at(at_ns);
    EXPECT_EQ(stopped.bring_up(), "(stopping)") << at_s;
    EXPECT_LE(stopped.channel.now_ns(), at_ns + 1'000'000) << at_s;
  }
}

TEST(FalconUpload, SlowerRatesFollowTwoFailures) {
  // The board hears nothing above 120 kBd, as a ROM with slow edges might.
  class SlowEdges final : public virtual_usb::UsbDevice {
   public:
    explicit SlowEdges(virtual_usb::VirtualFalcon& device) : device_(device) {}
    const virtual_usb::Descriptors& descriptors() const noexcept override { return device_.descriptors(); }
    virtual_usb::PacketReply control(const usb::Setup& setup, std::span<const std::uint8_t> data, std::uint16_t length,
                                     std::uint64_t now_ns) override {
      return device_.control(setup, data, length, now_ns);
    }
    virtual_usb::PacketReply out_packet(std::uint8_t endpoint, std::span<const std::uint8_t> bytes,
                                        std::uint64_t now_ns) override {
      if (device_.board().state() == FalconState::kAutoBaud && device_.baud().actual_hz > 120e3) return {};
      return device_.out_packet(endpoint, bytes, now_ns);
    }
    virtual_usb::PacketReply in_packet(std::uint8_t endpoint, std::uint64_t now_ns) override {
      return device_.in_packet(endpoint, now_ns);
    }
    void bus_reset(std::uint64_t now_ns) override { device_.bus_reset(now_ns); }

   private:
    virtual_usb::VirtualFalcon& device_;
  };
  virtual_usb::VirtualFalcon device{{}};
  SlowEdges slow(device);
  virtual_usb::VirtualChannel channel(slow);
  FalconSettings settings;
  settings.firmware = FalconBench::synthetic("known");
  FalconProtocol protocol(settings);
  const auto result = protocol.bring_up(channel);
  EXPECT_TRUE(result) << result.error().message;
  EXPECT_EQ(protocol.upload().attempts, 3);
  EXPECT_NEAR(protocol.upload().last.baud_hz, 115385, 1);
}

TEST(FalconFirmwareFile, IsCheckedBeforeAnythingStarts) {
  EXPECT_FALSE(load_firmware_image("/nonexistent/firmware.bin"));
  const auto wrong = make_firmware_image({1, 2, 3, 4}, "wrong.bin");
  ASSERT_FALSE(wrong);
  EXPECT_THAT(wrong.error(), HasSubstr("is not a Falcon firmware: it does not begin with the boot key AA 08"));
  const auto image = make_firmware_image(synthetic_boot_stream(8492), "made_up.bin");
  ASSERT_TRUE(image);
  EXPECT_EQ(image->known_as, "");
  EXPECT_EQ(image->sha256.size(), 64U);
}

}  // namespace
}  // namespace drivers::falcon
