// Who may talk to the viewer's server.
#include "tools/view/access.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cstdlib>
#include <fstream>

#include "tests/support/temporary_file.hpp"

namespace {

using view::allowed_host;
using view::allowed_origin;

TEST(Access, HostIsAnAddressAndNoName) {
  for (const char* const host :
       {"127.0.0.1:7125", "127.0.0.1", "localhost:7125", "localhost", "[::1]:7125", "[::1]", "192.168.1.20:9000"}) {
    EXPECT_TRUE(allowed_host(host)) << host;
  }
  for (const char* const host : {"", "evil.example", "evil.example:7125", "127.0.0.1.evil.example", "localhost.evil:1",
                                 "127.0.0.1:", "127.0.0.1:x", "127.0.0.1:123456", "[::1", "[::1]x", "[evil]:1", "1",
                                 "127.1:80", "127.0.0.1@evil.example"}) {
    EXPECT_FALSE(allowed_host(host)) << host;
  }
}

TEST(Access, OriginIsTheHostItself) {
  EXPECT_TRUE(allowed_origin("http://127.0.0.1:7125", "127.0.0.1:7125"));
  EXPECT_TRUE(allowed_origin("", "127.0.0.1:7125"));  // no browser
  for (const char* const origin : {"http://127.0.0.1:7126", "http://localhost:7125", "https://127.0.0.1:7125",
                                   "http://evil.example", "null", "http://127.0.0.1:7125/", "file://"}) {
    EXPECT_FALSE(allowed_origin(origin, "127.0.0.1:7125")) << origin;
  }
}

TEST(Access, TokensAreComparedWhole) {
  EXPECT_TRUE(view::same_token("abc", "abc"));
  EXPECT_FALSE(view::same_token("abc", "abd"));
  EXPECT_FALSE(view::same_token("abc", "abcd"));
  EXPECT_FALSE(view::same_token("", "a"));
}

class Token : public testing::Test {
 protected:
  Token() : file_(folder_.path() / "rtbus" / "view_token") { setenv("XDG_RUNTIME_DIR", folder_.path().c_str(), 1); }
  tests::TemporaryFolder folder_;
  std::filesystem::path file_;
};

TEST_F(Token, StaysFromStartToStartForItsOwnerOnly) {
  const std::string token = view::view_token();
  EXPECT_EQ(token.size(), 32U);
  EXPECT_EQ(view::view_token(), token);
  struct stat about {};
  ASSERT_EQ(::stat(file_.c_str(), &about), 0);
  EXPECT_EQ(about.st_mode & 0777U, 0600U);
}

TEST_F(Token, IsMadeAnewWhenOthersCouldReadItOrItIsNone) {
  const std::string token = view::view_token();
  ::chmod(file_.c_str(), 0644);
  const std::string second = view::view_token();
  EXPECT_NE(second, token);
  std::ofstream(file_) << "short";
  EXPECT_NE(view::view_token(), second);
  EXPECT_EQ(view::view_token().size(), 32U);
}

}  // namespace
