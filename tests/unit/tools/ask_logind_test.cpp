#include "tools/cli/host/ask_logind.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>

namespace tools {
namespace {

namespace fs = std::filesystem;

/// A small file system of its own.
class Logind : public testing::Test {
 protected:
  Logind() { fs::create_directories(root_ / "run/systemd/users"); }
  ~Logind() override { fs::remove_all(root_); }
  void write(const std::string& file, const std::string& text) {
    fs::create_directories((root_ / file).parent_path());
    std::ofstream(root_ / file) << text;
  }
  [[nodiscard]] LogindFacts ask(uid_t user = 1000) const { return ask_logind(user, "ada", root_); }

  fs::path root_ = fs::path(testing::TempDir()) / ("logind-" + std::to_string(getpid()) + "-" +
                                                   testing::UnitTest::GetInstance()->current_test_info()->name());
};

TEST_F(Logind, RemovesByDefault) {
  EXPECT_TRUE(ask().running);
  EXPECT_TRUE(ask().remove_ipc);
  EXPECT_EQ(ask().set_in, "");
  write("etc/systemd/logind.conf", "[Login]\n#RemoveIPC=no\n");
  EXPECT_TRUE(ask().remove_ipc) << "a comment says nothing";
}

TEST_F(Logind, ObeysTheFileAndTheLastDropIn) {
  write("etc/systemd/logind.conf", "[Login]\nRemoveIPC = no\n");
  EXPECT_FALSE(ask().remove_ipc);
  write("usr/lib/systemd/logind.conf.d/10-a.conf", "[Login]\nRemoveIPC=yes\n");
  EXPECT_TRUE(ask().remove_ipc);
  write("etc/systemd/logind.conf.d/20-b.conf", "[Login]\nRemoveIPC=off\n");
  EXPECT_FALSE(ask().remove_ipc);
  EXPECT_NE(ask().set_in.find("20-b.conf"), std::string::npos);
  write("run/systemd/logind.conf.d/20-b.conf", "[Login]\nRemoveIPC=yes\n");
  EXPECT_FALSE(ask().remove_ipc) << "/etc hides a file of the same name in /run";
}

TEST_F(Logind, SparesSystemUsersAndThoseWhoLinger) {
  EXPECT_TRUE(ask(0).system_user);
  EXPECT_TRUE(ask(999).system_user);
  EXPECT_FALSE(ask(1000).system_user);
  EXPECT_FALSE(ask().lingers);
  write("var/lib/systemd/linger/ada", "");
  EXPECT_TRUE(ask().lingers);
}

TEST_F(Logind, IsNotThereInAContainerWithoutSystemd) {
  fs::remove_all(root_ / "run");
  EXPECT_FALSE(ask().running);
}

}  // namespace
}  // namespace tools
