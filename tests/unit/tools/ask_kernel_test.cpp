#include "tools/cli/host/ask_kernel.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <thread>

#include "rtbus/realtime.hpp"

namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;

TEST(ParseProcessStat, ReadsTimesThreadsAndMemory) {
  const auto usage = tools::parse_process_stat(
      "4242 (haptic_node) S 1 4242 4242 0 -1 4194304 500 0 0 0 150 50 0 0 20 0 3 0 1000 123456 2500 184467", 100, 4096);
  ASSERT_TRUE(usage.has_value());
  EXPECT_EQ(usage->name, "haptic_node");
  EXPECT_EQ(usage->state, 'S');
  EXPECT_DOUBLE_EQ(usage->cpu_s, 2.0);
  EXPECT_EQ(usage->threads, 3u);
  EXPECT_EQ(usage->rss_bytes, 2500u * 4096u);
}

TEST(ParseProcessStat, IsNotConfusedByBracketsInTheName) {
  const auto usage =
      tools::parse_process_stat("7 (a) R (b) T 1 7 7 0 -1 0 0 0 0 0 1 1 0 0 20 0 1 0 5 6 7 8", 100, 4096);
  ASSERT_TRUE(usage.has_value());
  EXPECT_EQ(usage->name, "a) R (b");
  EXPECT_EQ(usage->state, 'T');
}

TEST(ParseProcessStat, RefusesATruncatedLine) {
  EXPECT_FALSE(tools::parse_process_stat("", 100, 4096).has_value());
  EXPECT_FALSE(tools::parse_process_stat("7 (a) S 1 7 7 0 -1", 100, 4096).has_value());
}

TEST(ParseMappedLibraries, TakesEachLibraryOnce) {
  EXPECT_THAT(tools::parse_mapped_libraries("7f00-7f01 r-xp 00000000 08:01 12   /usr/lib/libBullet.so.3.24\n"
                                            "7f01-7f02 rw-p 00001000 08:01 12   /usr/lib/libBullet.so.3.24\n"
                                            "7f03-7f04 r--p 00000000 08:01 13   /usr/lib/plugins/engine.so\n"
                                            "7f05-7f06 rw-s 00000000 00:19 14   /dev/shm/rtbus.soft.so_called\n"
                                            "7f07-7f08 rw-p 00000000 00:00 0    [heap]\n"),
              ElementsAre("/usr/lib/libBullet.so.3.24", "/usr/lib/plugins/engine.so"));
}

TEST(ParseMount, TakesTheLastMountOnExactlyThatPath) {
  const char* const mounts =
      "tmpfs /dev tmpfs rw 0 0\nnone /dev/shm ext4 ro 0 0\nshm /dev/shm tmpfs rw,nosuid,size=64k 0 0\nx /dev/shm2 ext4 "
      "rw 0 0\n";
  const auto mount = tools::parse_mount(mounts, "/dev/shm");
  ASSERT_TRUE(mount.has_value());
  EXPECT_EQ(mount->type, "tmpfs");
  EXPECT_EQ(mount->options, "rw,nosuid,size=64k");
  EXPECT_FALSE(tools::parse_mount(mounts, "/mnt").has_value());
}

// Of a child: what an emulator tells of the process that asks is its own invention.
TEST(AskProcess, SeesAProcessAndNoImaginaryOne) {
  const pid_t child = ::fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    for (;;) ::pause();
  }
  const auto seen = tools::ask_process(child);
  ::kill(child, SIGKILL);
  ::waitpid(child, nullptr, 0);
  ASSERT_TRUE(seen.has_value());
  EXPECT_GT(seen->rss_bytes, 100'000u);
  EXPECT_GE(seen->threads, 1u);
  EXPECT_FALSE(tools::ask_process(-1).has_value());
}

TEST(ThreadNames, NamesEachThreadOfAProcess) {
  // A sanitizer's runtime may start a thread of its own together with the first one.
  std::thread([] {}).join();
  const std::vector<std::string> before = tools::thread_names(::getpid());
  ASSERT_GE(before.size(), 1U);
  std::atomic<bool> named{false}, end{false};
  std::thread thread([&] {
    rtbus::name_this_thread("asked_for");
    named = true;
    while (!end) std::this_thread::yield();
  });
  while (!named) std::this_thread::yield();
  const std::vector<std::string> names = tools::thread_names(::getpid());
  end = true;
  thread.join();
  EXPECT_EQ(names.size(), before.size() + 1);
  EXPECT_EQ(std::count(before.begin(), before.end(), "asked_for"), 0);
  EXPECT_EQ(std::count(names.begin(), names.end(), "asked_for"), 1);
  EXPECT_TRUE(tools::thread_names(1 << 30).empty());
}

TEST(MappedLibraries, SeesTheCLibraryOfThisProcess) {
  EXPECT_THAT(tools::mapped_libraries(::getpid()), Contains(HasSubstr("libc.so")));
}

TEST(AskMachine, KnowsCpuKernelAndCores) {
  const tools::MachineFacts facts = tools::ask_machine();
  EXPECT_FALSE(facts.cpu.empty());
  EXPECT_THAT(facts.kernel, HasSubstr("Linux "));
  EXPECT_GE(facts.cores, 1u);
  EXPECT_GE(facts.usable_cores, 1u);
  EXPECT_GT(facts.memory_bytes, 1u << 20);
}

}  // namespace
