// What `rtbus devices` makes of the kernel's list of USB devices, in a made-up /sys and /dev.
#include "tools/cli/devices/vendor_devices.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <string>

#include "tests/support/users.hpp"

namespace tools {
namespace {

namespace fs = std::filesystem;
using drivers::usb::FoundDevice;
using ::testing::HasSubstr;
using ::testing::Not;

/// The rest of a test runs with the rights of a user who is not root, where the test began as root.
class AsOrdinaryUser {
 public:
  AsOrdinaryUser() : user_(::geteuid()) { EXPECT_EQ(::seteuid(user_ == 0 ? 65534 : user_), 0); }
  ~AsOrdinaryUser() { EXPECT_EQ(::seteuid(user_), 0); }
  AsOrdinaryUser(const AsOrdinaryUser&) = delete;
  AsOrdinaryUser& operator=(const AsOrdinaryUser&) = delete;

 private:
  uid_t user_;
};

class VendorDevices : public ::testing::Test {
 protected:
  void SetUp() override {
    umask_ = ::umask(022);  // everybody may look into the folders
    fs::remove_all(root_);
    fs::create_directories(root_ / "sys/bus/usb/devices");
    fs::create_directories(root_ / "dev/bus/usb/001");
    if (tests::is_root_alone()) GTEST_SKIP() << "root can become nobody else";
  }
  void TearDown() override {
    fs::remove_all(root_);
    (void)::umask(umask_);
  }

  /// A device at 1-PORT, whose USB node everybody may open.
  void plug(int port, const std::string& vendor, const std::string& product, const std::string& name) {
    const fs::path folder = folder_of(port);
    fs::create_directories(folder);
    for (const auto& [file, text] : {std::pair<const char*, std::string>{"idVendor", vendor},
                                     {"idProduct", product},
                                     {"product", name},
                                     {"serial", "S" + std::to_string(port)},
                                     {"busnum", "1"},
                                     {"devnum", std::to_string(port)}}) {
      std::ofstream(folder / file) << text << "\n";
    }
    node("bus/usb/001/00" + std::to_string(port), 0666);
  }
  /// Gives the device a port, as the kernel's drivers do: "1-1:1.0/tty/ttyACM0".
  /// Mode 0000 keeps out its owner too, whoever runs the test.
  void port(int at, const std::string& inside, unsigned mode) {
    fs::create_directories(folder_of(at) / inside);
    node(fs::path(inside).filename(), mode);
  }
  std::vector<FoundDevice> look() const {
    const AsOrdinaryUser user;
    auto out = vendor_devices_on_bus(root_);
    std::sort(out.begin(), out.end(), [](const auto& a, const auto& b) { return a.serial < b.serial; });
    return out;
  }

 private:
  fs::path folder_of(int port) const { return root_ / "sys/bus/usb/devices" / ("1-" + std::to_string(port)); }
  void node(const fs::path& name, unsigned mode) const {
    std::ofstream(root_ / "dev" / name) << "";
    ASSERT_EQ(::chmod((root_ / "dev" / name).c_str(), mode), 0);
  }

 protected:
  const fs::path root_ = fs::temp_directory_path() / ("rtbus-bus-" + std::to_string(::getpid()));

 private:
  mode_t umask_ = 0;
};

TEST_F(VendorDevices, ASerialPortOrHidNodeThatIsNotPermittedIsNamedWithTheRules) {
  plug(1, "2988", "0302", "Touch");
  port(1, "1-1:1.0/tty/ttyACM7", 0000);
  plug(2, "2988", "0304", "Touch");
  port(2, "1-2:1.0/0003:2988:0304.0001/hidraw/hidraw3", 0000);
  plug(3, "2988", "0302", "Touch");
  port(3, "1-3:1.0/tty/ttyACM8", 0666);
  const auto found = look();
  ASSERT_EQ(found.size(), 3u);
  for (const FoundDevice& each : found) EXPECT_EQ(each.driver, "openhaptics");
  EXPECT_FALSE(found[0].permitted);
  EXPECT_THAT(found[0].remedy, HasSubstr("/dev/ttyACM7 not permitted; install the rules once"));
  EXPECT_THAT(found[0].remedy, HasSubstr("70-rtbus-haptics.rules"));
  EXPECT_FALSE(found[1].permitted);
  EXPECT_THAT(found[1].remedy, HasSubstr("/dev/hidraw3 not permitted"));
  EXPECT_THAT(found[1].remedy, Not(HasSubstr("ttyACM"))) << "that is another device's";
  EXPECT_TRUE(found[2].permitted);
  EXPECT_THAT(found[2].remedy, Not(HasSubstr("not permitted")));
}

TEST_F(VendorDevices, DoctorTellsThePermissionToo) {
  plug(1, "2988", "0302", "Touch");
  port(1, "1-1:1.0/tty/ttyACM7", 0000);
  const AsOrdinaryUser user;
  const auto findings = vendor_findings(root_);
  ASSERT_FALSE(findings.empty());
  EXPECT_EQ(findings[0].what, "3D Systems 2988:0302");
  EXPECT_FALSE(findings[0].ok);
  EXPECT_THAT(findings[0].remedy, HasSubstr("/dev/ttyACM7 not permitted"));
}

TEST_F(VendorDevices, AnInverse3IsNamedWhereItTellsItsNameAndOtherTeensysAreLeftOut) {
  plug(1, "16c0", "0483", "Haply inverse3");
  plug(2, "16c0", "0483", "USB Serial");  // an older Inverse3, an arm, or anything else
  plug(3, "2fe3", "0100", "ZEPHYR Haply USB Transceiver");
  const auto found = look();
  ASSERT_EQ(found.size(), 2u);
  for (const FoundDevice& each : found) EXPECT_EQ(each.driver, "haply");
  EXPECT_EQ(found[0].product, "Haply inverse3");
}

}  // namespace
}  // namespace tools
