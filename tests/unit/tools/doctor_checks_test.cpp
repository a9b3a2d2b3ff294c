#include "tools/cli/doctor/doctor_checks.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

namespace {

using testing::HasSubstr;
using tools::Health;

/// A machine on which nothing is wrong.
tools::DoctorFacts perfect() {
  tools::DoctorFacts facts;
  facts.machine.cpu = "Any CPU";
  facts.machine.cores = facts.machine.usable_cores = 4;
  facts.machine.kernel = "Linux 6.1.0-rt";
  facts.machine.preemption = "PREEMPT_RT";
  facts.machine.clocksource = "tsc";
  facts.machine.governor = "performance";
  facts.limits.rtprio = 98;
  facts.limits.lowest_nice = -15;
  facts.limits.memlock_bytes = UINT64_MAX;
  facts.limits.rt_runtime_us = 950000;
  facts.limits.rt_period_us = 1000000;
  facts.shm = tools::MountFacts{"tmpfs", "rw,nosuid", 8ull << 30, 8ull << 30};
  facts.clock_ns = 25.0;
  facts.wakeup.grant.fifo = facts.wakeup.grant.memory_locked = facts.wakeup.grant.dma_latency_held = true;
  facts.wakeup.grant.priority = 80;
  facts.wakeup.due = facts.wakeup.served = 2000;
  facts.wakeup.p50_us = 3.0;
  facts.wakeup.p99_us = 9.0;
  facts.wakeup.max_us = 40.0;
  return facts;
}

tools::DoctorCheck check_of(const tools::DoctorFacts& facts, const std::string& id) {
  const std::vector<tools::DoctorCheck> checks = tools::judge(facts);
  const auto found = std::find_if(checks.begin(), checks.end(), [&](const auto& check) { return check.id == id; });
  EXPECT_NE(found, checks.end()) << id;
  return found != checks.end() ? *found : tools::DoctorCheck{};
}

TEST(Doctor, FindsNothingOnAPerfectMachine) {
  for (const tools::DoctorCheck& check : tools::judge(perfect())) {
    EXPECT_EQ(check.health, Health::kOk) << check.id << ": " << check.measured;
    EXPECT_TRUE(check.remedy.empty()) << check.id;
    EXPECT_FALSE(check.measured.empty()) << check.id;
  }
}

TEST(Doctor, SaysHowToGetTheBridgeAndWarnsOfNothing) {
  auto facts = perfect();
  facts.bridge_is_here = false;
  EXPECT_EQ(check_of(facts, "bridge").health, Health::kOk);
  EXPECT_EQ(check_of(facts, "bridge").measured, "not installed");
  EXPECT_THAT(check_of(facts, "bridge").remedy, HasSubstr("rtbus-bridge"));
}

TEST(Doctor, WarnsOfTopicsThatVanishAtLogOut) {
  auto facts = perfect();
  facts.logind.running = true;
  EXPECT_EQ(check_of(facts, "remove_ipc").health, Health::kWarn);
  EXPECT_THAT(check_of(facts, "remove_ipc").measured, HasSubstr("RemoveIPC=yes, the default"));
  EXPECT_THAT(check_of(facts, "remove_ipc").remedy, HasSubstr("enable-linger"));
  EXPECT_TRUE(tools::healthy(tools::judge(facts))) << "a warning, not a failure";
  facts.logind.system_user = true;
  EXPECT_EQ(check_of(facts, "remove_ipc").health, Health::kOk);
  facts.logind.system_user = false;
  facts.logind.lingers = true;
  EXPECT_EQ(check_of(facts, "remove_ipc").health, Health::kOk);
  facts.logind.lingers = false;
  facts.logind.remove_ipc = false;
  facts.logind.set_in = "/etc/systemd/logind.conf";
  EXPECT_EQ(check_of(facts, "remove_ipc").health, Health::kOk);
}

TEST(Doctor, FailsWithoutSchedFifoAndSaysHowToGetIt) {
  auto facts = perfect();
  facts.wakeup.grant.fifo = false;
  facts.limits.rtprio = 0;
  EXPECT_EQ(check_of(facts, "sched_fifo").health, Health::kFail);
  EXPECT_THAT(check_of(facts, "sched_fifo").remedy, HasSubstr("limits.d"));
  EXPECT_EQ(check_of(facts, "rtprio").health, Health::kWarn);
  EXPECT_FALSE(tools::healthy(tools::judge(facts)));
}

TEST(Doctor, AcceptsACapabilityInPlaceOfALimit) {
  auto facts = perfect();
  facts.limits.rtprio = 0;
  facts.limits.lowest_nice = -14;
  facts.limits.memlock_bytes = 65536;
  EXPECT_EQ(check_of(facts, "rtprio").health, Health::kWarn);
  EXPECT_EQ(check_of(facts, "nice").health, Health::kWarn);
  EXPECT_THAT(check_of(facts, "nice").remedy, HasSubstr("@realtime - nice -15"));
  EXPECT_EQ(check_of(facts, "memlock").health, Health::kWarn);
  facts.limits.cap_sys_nice = facts.limits.cap_ipc_lock = true;
  EXPECT_EQ(check_of(facts, "rtprio").health, Health::kOk);
  EXPECT_EQ(check_of(facts, "nice").health, Health::kOk);
  EXPECT_EQ(check_of(facts, "memlock").health, Health::kOk);
}

TEST(Doctor, WarnsOfAVirtualMachineButNotOfAContainer) {
  auto facts = perfect();
  facts.machine.virtualization = "KVM";
  EXPECT_EQ(check_of(facts, "virtual_machine").health, Health::kWarn);
  facts.machine.virtualization = "container";
  EXPECT_EQ(check_of(facts, "virtual_machine").health, Health::kOk);
}

TEST(Doctor, TakesAWarningForHealthy) {
  auto facts = perfect();
  facts.machine.governor = "powersave";
  EXPECT_EQ(check_of(facts, "governor").health, Health::kWarn);
  EXPECT_TRUE(tools::healthy(tools::judge(facts)));
}

TEST(Doctor, TellsAFullAMissingAndAReadOnlyShmApart) {
  auto facts = perfect();
  facts.shm->free_bytes = 32u << 20;
  EXPECT_EQ(check_of(facts, "dev_shm").health, Health::kWarn);
  facts.shm->free_bytes = 1u << 20;
  EXPECT_EQ(check_of(facts, "dev_shm").health, Health::kFail);
  facts = perfect();
  facts.shm->options = "ro,nosuid";
  EXPECT_EQ(check_of(facts, "dev_shm").health, Health::kFail);
  facts.shm.reset();
  EXPECT_THAT(check_of(facts, "dev_shm").remedy, HasSubstr("mount"));
}

TEST(Doctor, JudgesTheWakeUpsByTheShareThatComesLate) {
  auto facts = perfect();
  facts.wakeup.max_us = 1500.0;
  EXPECT_EQ(check_of(facts, "wakeup_latency").health, Health::kWarn);
  facts.wakeup.p99_us = 1200.0;
  EXPECT_EQ(check_of(facts, "wakeup_latency").health, Health::kFail);
  facts = perfect();
  facts.wakeup.overruns = 40;
  EXPECT_EQ(check_of(facts, "wakeup_latency").health, Health::kFail);
  facts = perfect();
  facts.wakeup.due = facts.wakeup.served = 0;
  EXPECT_EQ(check_of(facts, "wakeup_latency").health, Health::kFail);
}

TEST(Doctor, WarnsOfASlowClockAndHardThrottling) {
  auto facts = perfect();
  facts.clock_ns = 400.0;
  EXPECT_EQ(check_of(facts, "clocksource").health, Health::kWarn);
  facts.limits.rt_runtime_us = 100000;
  EXPECT_EQ(check_of(facts, "rt_throttling").health, Health::kWarn);
  facts.limits.rt_runtime_us = -1;
  EXPECT_EQ(check_of(facts, "rt_throttling").measured, "off");
}

TEST(Doctor, CountsOnlyDeadSegments) {
  auto facts = perfect();
  facts.topics.resize(4);
  facts.topics[0].writer_alive = true;
  facts.topics[3].problem = "belongs to another user";  // its writer may live
  facts.topics[1].segment_bytes = facts.topics[2].segment_bytes = 4096;
  EXPECT_THAT(check_of(facts, "stale_segments").measured, HasSubstr("2 of dead processes, 8.0 KiB"));
  EXPECT_EQ(check_of(facts, "stale_segments").remedy, "rtbus clean");
}

}  // namespace
