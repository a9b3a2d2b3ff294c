// Two users on one machine, neither of them root: what one can do to the other's topics. The threat model is in
// SECURITY.md.
#include <grp.h>

#include <fstream>
#include <iterator>
#include <vector>

#include "rtbus/topic.hpp"
#include "tests/support/users.hpp"
#include "tests/unit/rtbus/scratch_session.hpp"

namespace rtbus::test {
namespace {

constexpr uid_t kOwner = 64'001, kOther = 64'002;
constexpr gid_t kGroup = 64'010;

/// From now on this process is that user, and a member of `groups` besides its own.
bool become(uid_t user, const std::vector<gid_t>& groups = {}) {
  return ::setgroups(groups.size(), groups.data()) == 0 && ::setresgid(user, user, user) == 0 &&
         ::setresuid(user, user, user) == 0;
}

class OtherUser : public testing::Test {
 protected:
  void SetUp() override {
    if (::geteuid() != 0 || tests::is_root_alone()) GTEST_SKIP() << "needs root to be two users";
  }
  ScratchSession session_;
};

TEST_F(OtherUser, ANameThatSomebodyElseHasTakenIsRefused) {
  // With a whole, living segment that everybody may read and write.
  Child squatter([&] {
    session_->mode = 0666;
    auto* writer = new auto(become(kOther) ? Writer<Probe>::create(session_, "x")
                                           : Result<Writer<Probe>, TopicError>(Failure{TopicError::kSystem}));
    return writer->has_value() && ((*writer)->publish(Probe{1, 2.0, {}}, 1), true);
  });
  ASSERT_TRUE(squatter.succeeded());
  Child owner([&] {
    if (!become(kOwner)) return false;
    auto writer = Writer<Probe>::create(session_, "x");
    auto reader = Reader<Probe>::open(session_, "x");
    // A live writer holds it; who that is matters to the reader.
    return !writer && writer.error() == TopicError::kAlreadyOwned && !reader &&
           reader.error() == TopicError::kPermission;
  });
  EXPECT_TRUE(owner.succeeded()) << "it neither writes nor believes a stranger's segment";
}

TEST_F(OtherUser, ASquatterThatHasGoneIsRefusedToo) {
  {
    Child squatter([&] { return become(kOther) && (std::ofstream(session_.path("y")) << "anything").good(); });
    ASSERT_TRUE(squatter.succeeded());
  }
  Child owner([&] {
    if (!become(kOwner)) return false;
    auto writer = Writer<Probe>::create(session_, "y");
    return !writer && writer.error() == TopicError::kPermission;
  });
  ::unlink(session_.path("y").c_str());
  EXPECT_TRUE(owner.succeeded()) << "/dev/shm is sticky: what belongs to somebody else cannot be replaced";
}

TEST_F(OtherUser, ALinkLeadsNoWriterElsewhere) {
  const std::string victim = session_.path("victim");
  const std::string secret(4096, 's');
  std::ofstream(victim) << secret;
  ASSERT_EQ(::chown(victim.c_str(), kOwner, kOwner), 0);
  ASSERT_EQ(::symlink(victim.c_str(), session_.path("soft").c_str()), 0);
  ASSERT_EQ(::lchown(session_.path("soft").c_str(), kOther, kOther), 0);
  // As by a user whose kernel lets it link to anybody's files (fs.protected_hardlinks = 0).
  ASSERT_EQ(::link(victim.c_str(), session_.path("hard").c_str()), 0);
  Child owner([&] {
    if (!become(kOwner)) return false;
    (void)Writer<Probe>::create(session_, "soft");
    (void)Writer<Probe>::create(session_, "hard");
    return true;
  });
  ASSERT_TRUE(owner.succeeded());
  std::ifstream file(victim);
  const std::string now{std::istreambuf_iterator<char>(file), {}};
  for (const char* name : {"victim", "soft", "hard"}) ::unlink(session_.path(name).c_str());
  EXPECT_EQ(now, secret) << "the other name of the file is not the bus's to write";
}

TEST_F(OtherUser, ReadsNothingWithoutTheGroupAndWritesNothingWithIt) {
  session_->mode = 0640;
  session_->group = kGroup;
  Child owner([&] {
    auto* writer = new auto(become(kOwner, {kGroup}) ? Writer<Probe>::create(session_, "x")
                                                     : Result<Writer<Probe>, TopicError>(Failure{TopicError::kSystem}));
    return writer->has_value() && ((*writer)->publish(Probe{7, 0.0, {}}, 1), true);
  });
  ASSERT_TRUE(owner.succeeded());
  Child stranger([&] {
    auto reader = Reader<Probe>::open(session_, "x", {.trust = OwnerTrust::kAnyone});
    if (!become(kOther)) return false;
    auto denied = Reader<Probe>::open(session_, "x", {.trust = OwnerTrust::kAnyone});
    return reader.has_value() && !denied && denied.error() == TopicError::kPermission;
  });
  EXPECT_TRUE(stranger.succeeded());
  Child member([&] {
    if (!become(kOther, {kGroup})) return false;
    auto reader = Reader<Probe>::open(session_, "x");
    Stamped<Probe> sample;
    if (!reader || reader->read_latest(sample) != ReadStatus::kFresh || sample.value.number != 7) return false;
    auto writer = Writer<Probe>::create(session_, "x");
    return !writer && ::open(session_.path("x").c_str(), O_RDWR | O_CLOEXEC) < 0 &&
           ::unlink(session_.path("x").c_str()) != 0 && remove_dead(session_->name).names.empty();
  });
  EXPECT_TRUE(member.succeeded());
}

}  // namespace
}  // namespace rtbus::test
