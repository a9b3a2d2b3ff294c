// The keys that the device files of all USB drivers have in common: what is wrong with one is said with file, line,
// key, value and remedy. And who uses a device.
#include "drivers/usb_host/open_options.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "drivers/usb_host/libusb_context.hpp"
#include "drivers/virtual_devices/kinds.hpp"
#include "tests/support/bad_config.hpp"
#include "tests/support/process.hpp"
#include "tests/support/temporary_file.hpp"

namespace drivers::usb {
namespace {

using tests::BadConfig;

class BadUsb : public testing::TestWithParam<BadConfig> {};
TEST_P(BadUsb, IsRefusedWithItsReason) {
  EXPECT_TRUE(tests::fails_as_expected(
      GetParam(), [](const std::string& file, const std::vector<rtbus::config::Override>& overrides) {
        rtbus::config::Map map = rtbus::config::load(file, overrides);
        (void)map.choice("schema", {"device/1"});
        (void)map.choice("driver", {"falcon"});
        (void)parse_open_options(map, virtual_usb::find_kind("falcon"));
        map.finish();
      }));
}
INSTANTIATE_TEST_SUITE_P(Files, BadUsb, testing::ValuesIn(tests::bad_configs("usb")), tests::bad_config_name);

TEST(Users, AreThoseWhoHaveTheFileOpen) {
  const std::string file = testing::TempDir() + "users" + std::to_string(getpid());
  tests::Child user({"/bin/sh", "-c", "exec 9>" + file + "; exec sleep 60"});
  const std::string pid = "(pid " + std::to_string(user.pid()) + ")";
  std::vector<std::string> users;
  EXPECT_TRUE(tests::eventually(10.0, [&] {
    users = users_of({"/dev/bus/usb/001/099", file});
    return users.size() == 1 && users[0] == "sleep " + pid;
  })) << testing::PrintToString(users);
  user.end(SIGKILL);
  EXPECT_TRUE(tests::eventually(10.0, [&] { return users_of({file}).empty(); }));
  ::unlink(file.c_str());
}

}  // namespace
}  // namespace drivers::usb
