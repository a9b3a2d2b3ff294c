// Finding devices on a bus that umockdev makes up: what the user is told when the right one is not clear. Runs under
// umockdev-wrapper.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <umockdev.h>

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <utility>

#include "drivers/usb_host/libusb_context.hpp"
#include "drivers/usb_module/usb_module.hpp"
#include "tests/support/echo_device.hpp"

namespace drivers::usb {
namespace {

using testing::HasSubstr;

class Bus : public testing::Test {
 protected:
  void SetUp() override {
    const char* const preload = std::getenv("LD_PRELOAD");
    if (preload == nullptr || std::string(preload).find("umockdev") == std::string::npos) {
      GTEST_SKIP() << "run it under umockdev-wrapper";
    }
    bed_ = umockdev_testbed_new();
  }
  void TearDown() override {
    if (bed_ != nullptr) g_object_unref(bed_);
  }

  /// Plugs an echo device into port `port` of bus 1; with other ids for another kind of device.
  void plug(int port, const std::string& serial, std::uint16_t vendor = tests::EchoDevice::kVendor,
            std::uint16_t product = tests::EchoDevice::kProduct, const std::string& name = "Echo") {
    const tests::EchoDevice device;
    auto first = device.descriptors().device;
    for (const int i : {0, 1}) {
      first[static_cast<std::size_t>(8 + i)] = static_cast<std::uint8_t>(vendor >> 8 * i);
      first[static_cast<std::size_t>(10 + i)] = static_cast<std::uint8_t>(product >> 8 * i);
    }
    std::string hex;
    for (const auto* part : {&std::as_const(first), &device.descriptors().configuration}) {
      for (const unsigned byte : *part) {
        char text[3];
        std::snprintf(text, sizeof text, "%02X", byte);
        hex += text;
      }
    }
    const std::string number = "00" + std::to_string(port + 1);
    const std::string text =
        "P: /devices/usb1/1-" + std::to_string(port) + "\nN: bus/usb/001/" + number +
        "\nE: SUBSYSTEM=usb\nE: DEVTYPE=usb_device\nE: DRIVER=usb\nE: BUSNUM=001\nE: DEVNUM=" + number +
        "\nE: DEVNAME=/dev/bus/usb/001/" + number + "\nE: MAJOR=189\nE: MINOR=" + std::to_string(port) +
        "\nA: busnum=1\\n\nA: devnum=" + std::to_string(port + 1) +
        "\\n\nA: speed=12\\n\nA: bConfigurationValue=1\\n\nA: serial=" + serial + "\\n\nA: product=" + name +
        "\\n\nH: descriptors=" + hex + "\n";
    GError* error = nullptr;
    ASSERT_TRUE(umockdev_testbed_add_from_string(bed_, text.c_str(), &error)) << (error ? error->message : "");
  }

  static std::string problem_of(const std::string& serial, std::uint16_t product = tests::EchoDevice::kProduct) {
    auto context = make_context(true);
    if (!context) return context.error().message;
    const auto handle = open_device(context->get(), {tests::EchoDevice::kVendor, product, serial, {0}});
    return handle ? "" : handle.error().message;
  }

  UMockdevTestbed* bed_ = nullptr;
};

TEST_F(Bus, ListsWhatIsPluggedIn) {
  ASSERT_NO_FATAL_FAILURE(plug(1, "A1"));
  ASSERT_NO_FATAL_FAILURE(plug(2, "B2"));
  auto context = make_context(true);
  ASSERT_TRUE(context) << context.error().message;
  const auto found = list_devices(context->get());
  ASSERT_EQ(found.size(), 2u);
  EXPECT_EQ(found[0].vendor_id, tests::EchoDevice::kVendor);
  EXPECT_EQ(found[0].product, "Echo");
  EXPECT_EQ(found[0].serial == "A1" ? found[1].serial : found[0].serial, "B2");
}

TEST_F(Bus, SaysThatNothingOfThatKindIsThere) {
  ASSERT_NO_FATAL_FAILURE(plug(1, "A1"));
  EXPECT_THAT(problem_of("", 0x7777), HasSubstr("no USB device 1209:7777 is plugged in; check cable and power"));
}

TEST_F(Bus, ListsTheSerialsWhenThereAreSeveral) {
  ASSERT_NO_FATAL_FAILURE(plug(1, "A1"));
  ASSERT_NO_FATAL_FAILURE(plug(2, "B2"));
  const std::string several = problem_of("");
  EXPECT_THAT(several, HasSubstr("several USB devices 1209:0001"));
  EXPECT_THAT(several, HasSubstr("A1"));
  EXPECT_THAT(several, HasSubstr("B2"));
  EXPECT_THAT(several, HasSubstr("serial:"));
  const std::string other = problem_of("C3");
  EXPECT_THAT(other, HasSubstr("no USB device 1209:0001 with serial C3 is plugged in; there is: "));
}

// What `rtbus devices` does with a bus: a board that shares its ids with many others is not written to unless its user
// has named it. (Nothing answers here: being asked fails, but it was tried.)
TEST_F(Bus, ATeensyIsAskedOnlyWhenItWasNamed) {
  ASSERT_NO_FATAL_FAILURE(plug(1, "T1", 0x16c0, 0x0483));
  ASSERT_NO_FATAL_FAILURE(plug(2, "E2"));
  const auto module = load_usb_module();
  ASSERT_TRUE(module) << module.error();
  ListRequest request;
  request.ask = true;
  FoundDevices found = (*module)->list(request);
  ASSERT_EQ(found.devices.size(), 2u) << found.problem;
  const auto by_serial = [&](const std::string& serial) {
    return *std::find_if(found.devices.begin(), found.devices.end(), [&](const auto& d) { return d.serial == serial; });
  };
  EXPECT_EQ(by_serial("T1").driver, "phantom");
  EXPECT_FALSE(by_serial("T1").asked);
  EXPECT_EQ(by_serial("T1").not_asked, "many kinds of device have these USB ids");
  EXPECT_THAT(by_serial("T1").remedy, HasSubstr("`rtbus devices 16c0:0483:T1` asks it"));
  EXPECT_EQ(by_serial("E2").driver, "") << "none of ours: not asked either";
  EXPECT_FALSE(by_serial("E2").asked);
  request.named = "16C0:0483:T1";
  found = (*module)->list(request);
  EXPECT_FALSE(by_serial("T1").asked);
  EXPECT_THAT(by_serial("T1").not_asked, testing::Not(HasSubstr("many kinds"))) << "it was tried";
}

// The Haply Inverse3 has the ids of a Teensy. Its service has it: no driver of ours takes it, and nothing is sent to
// it.
TEST_F(Bus, AnInverse3ThatTellsItsNameIsNoArm) {
  ASSERT_NO_FATAL_FAILURE(plug(1, "H1", 0x16c0, 0x0483, "Haply inverse3"));
  const auto module = load_usb_module();
  ASSERT_TRUE(module) << module.error();
  ListRequest request;
  request.ask = true;
  request.named = "16c0:0483:H1";
  const FoundDevices found = (*module)->list(request);
  ASSERT_EQ(found.devices.size(), 1u) << found.problem;
  EXPECT_EQ(found.devices[0].product, "Haply inverse3");
  EXPECT_EQ(found.devices[0].driver, "");
  EXPECT_FALSE(found.devices[0].asked);
  EXPECT_EQ(found.devices[0].not_asked, "") << "it was not even considered";
}

TEST(FoundDevices, AreCalledByIdSerialBothOrDriver) {
  FoundDevice device;
  device.vendor_id = 0x0403;
  device.product_id = 0xcb48;
  device.serial = "VF000001";
  device.driver = "falcon";
  for (const char* const name : {"0403:cb48", "0403:CB48", "VF000001", "falcon", "0403:cb48:VF000001"}) {
    EXPECT_TRUE(device.is(name)) << name;
  }
  for (const char* const name : {"", "0403", "0403:cb49", "0403:cb48:", "0403:cb48:VF000002", "VF00000", "phantom"}) {
    EXPECT_FALSE(device.is(name)) << name;
  }
}

TEST(Explain, PermissionNamesTheRulesAndHowToInstallThem) {
  const std::string text = explain(-3 /* LIBUSB_ERROR_ACCESS */, "opening");
  EXPECT_THAT(text, HasSubstr("config/udev/70-rtbus-haptics.rules"));
  EXPECT_THAT(text, HasSubstr("udevadm control --reload"));
  EXPECT_THAT(explain(-6 /* LIBUSB_ERROR_BUSY */, "claiming"), HasSubstr("another program has it"));
  EXPECT_EQ(explain(-6, "claiming", {"haptic_node (pid 4711)"}),
            "claiming: haptic_node (pid 4711) has it; end that program");
}

}  // namespace
}  // namespace drivers::usb
