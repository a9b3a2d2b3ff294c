// Refuses to run where others would hear the participants of these tests, and sees to it that they leave no file.
#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>

namespace {

std::string own_network() {
  std::array<char, 64> link{};
  const ssize_t length = ::readlink("/proc/self/ns/net", link.data(), link.size());
  return length > 0 ? std::string(link.data(), static_cast<std::size_t>(length)) : "";
}

class OwnNetwork : public testing::Environment {
 public:
  void SetUp() override {
    const char* const outer = std::getenv("RTBUS_OUTER_NETWORK");
    if (outer != nullptr && own_network() != outer) return;
    std::fputs("bridge_tests: start it as tests/bridge/in_namespace build/bin/bridge_tests\n", stderr);
    std::exit(1);
  }
  /// Fast DDS's shared memory is switched off.
  void TearDown() override {
    for (const auto& entry : std::filesystem::directory_iterator("/dev/shm")) {
      const std::string name = entry.path().filename();
      EXPECT_FALSE(name.starts_with("fastrtps") || name.starts_with("fastdds")) << name;
    }
  }
};

// NOLINTNEXTLINE(cert-err58-cpp): GoogleTest owns it
[[maybe_unused]] const testing::Environment* const kOwnNetwork = testing::AddGlobalTestEnvironment(new OwnNetwork);

}  // namespace
