// The socket of the orders: who may send what, and what comes back.
#include "tools/cli/orders/order_socket.hpp"

#include <gmock/gmock.h>
#include <grp.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <thread>

#include "rtbus/clock.hpp"
#include "tests/support/users.hpp"

namespace tools {
namespace {

using Json = nlohmann::json;
using testing::HasSubstr;

/// A served socket that gives each order back as {"ok": true, "got": order}.
class Served {
 public:
  explicit Served(const std::string& session) {
    auto opened = OrderSocket::open(session, [](const Json& order) { return Json{{"ok", true}, {"got", order}}; });
    EXPECT_TRUE(opened) << opened.error();
    socket_ = std::move(*opened);
    thread_ = std::thread([this] {
      while (!done_.load()) (void)socket_->serve(5 * rtbus::kNsPerMs);
    });
  }
  ~Served() {
    done_ = true;
    thread_.join();
  }
  [[nodiscard]] const std::string& path() const { return socket_->path(); }

 private:
  std::unique_ptr<OrderSocket> socket_;
  std::atomic<bool> done_{false};
  std::thread thread_;
};

std::string name_of_this_test() {
  return "orders" + std::to_string(::getpid()) + "_" +
         std::to_string(testing::UnitTest::GetInstance()->current_test_info()->line());
}

int connect_raw(const std::string& path) {
  const int fd = ::socket(AF_UNIX, SOCK_SEQPACKET, 0);
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  std::strncpy(address.sun_path, path.c_str(), sizeof address.sun_path - 1);
  EXPECT_EQ(::connect(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  return fd;
}

std::string say(int fd, const std::string& text) {
  EXPECT_EQ(::send(fd, text.data(), text.size(), 0), static_cast<ssize_t>(text.size()));
  std::string reply(8192, '\0');
  const ssize_t got = ::recv(fd, reply.data(), reply.size(), 0);
  reply.resize(got < 0 ? 0 : static_cast<std::size_t>(got));
  return reply;
}

TEST(OrderSocket, AnswersAnOrder) {
  const Served served(name_of_this_test());
  const auto reply = send_order(name_of_this_test(), {{"order", "estop"}});
  ASSERT_TRUE(reply) << reply.error();
  EXPECT_EQ((*reply)["got"]["order"], "estop");
}

TEST(OrderSocket, IsForItsUserAloneAndGoneAfterwards) {
  std::string path;
  {
    const Served served(name_of_this_test());
    path = served.path();
    struct stat info {};
    ASSERT_EQ(::stat(path.c_str(), &info), 0);
    EXPECT_EQ(info.st_mode & 0777, 0600u);
  }
  EXPECT_NE(::access(path.c_str(), F_OK), 0);
  EXPECT_THAT(send_order(name_of_this_test(), {{"order", "state"}}).error(), HasSubstr("takes no orders"));
}

/// What another user gets there: an answer, nothing (the connection ends), or no connection.
enum class Gets { kAnswer, kNothing, kNoConnection };

Gets another_user_gets(const std::string& path) {
  constexpr uid_t kOther = 64'002;
  const pid_t child = ::fork();
  if (child == 0) {
    if (::setgroups(0, nullptr) != 0 || ::setresgid(kOther, kOther, kOther) != 0 ||
        ::setresuid(kOther, kOther, kOther) != 0) {
      ::_exit(9);
    }
    const int fd = ::socket(AF_UNIX, SOCK_SEQPACKET, 0);
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::strncpy(address.sun_path, path.c_str(), sizeof address.sun_path - 1);
    if (::connect(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
      ::_exit(errno == EACCES ? static_cast<int>(Gets::kNoConnection) : 9);
    }
    constexpr std::string_view kEstop = R"({"order": "estop"})";
    char reply[4096];
    const bool sent = ::send(fd, kEstop.data(), kEstop.size(), MSG_NOSIGNAL) > 0;
    const bool answered = sent && ::recv(fd, reply, sizeof reply, 0) > 0;
    ::_exit(static_cast<int>(answered ? Gets::kAnswer : Gets::kNothing));
  }
  int status = 0;
  EXPECT_EQ(::waitpid(child, &status, 0), child);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) < 9) << status;
  return static_cast<Gets>(WEXITSTATUS(status));
}

// Three walls: the folder, the socket's mode, and the kernel, which names the caller.
TEST(OrderSocket, AnotherUserOrdersNothing) {
  if (::geteuid() != 0 || tests::is_root_alone()) GTEST_SKIP() << "needs root to be two users";
  char folder[] = "/tmp/rtbus-orders-XXXXXX";
  ASSERT_NE(::mkdtemp(folder), nullptr);
  const char* const before = std::getenv("XDG_RUNTIME_DIR");
  const std::string kept = before != nullptr ? before : "";
  ::setenv("XDG_RUNTIME_DIR", folder, 1);
  {
    const Served served(name_of_this_test());
    const std::string& path = served.path();
    ASSERT_EQ(path.rfind(folder, 0), 0u) << path;
    EXPECT_EQ(another_user_gets(path), Gets::kNoConnection) << "the folder has mode 0700";
    ASSERT_EQ(::chmod(folder, 0755), 0);
    EXPECT_EQ(another_user_gets(path), Gets::kNoConnection) << "the socket has mode 0600";
    ASSERT_EQ(::chmod(path.c_str(), 0666), 0);
    EXPECT_EQ(another_user_gets(path), Gets::kNothing) << "the kernel names the caller";
    const int own = connect_raw(path);
    EXPECT_THAT(say(own, R"({"order": "estop"})"), HasSubstr("estop"));
    ::close(own);
  }
  before != nullptr ? ::setenv("XDG_RUNTIME_DIR", kept.c_str(), 1) : ::unsetenv("XDG_RUNTIME_DIR");
  ::rmdir(folder);
}

TEST(OrderSocket, RefusesWhatIsNoOrderAndGoesOn) {
  const Served served(name_of_this_test());
  const int client = connect_raw(served.path());
  for (const std::string& wrong : {std::string("not json"), std::string("[1]"), std::string("{\"order\": "),
                                   std::string("\0\xff\x80", 3), std::string("{}").insert(1, 5000, ' ')}) {
    const Json reply = Json::parse(say(client, wrong), nullptr, false);
    ASSERT_TRUE(reply.is_object()) << wrong.substr(0, 40);
    EXPECT_FALSE(reply["ok"]) << wrong.substr(0, 40);
  }
  EXPECT_THAT(say(client, "{\"order\": \"state\"}"), HasSubstr("\"ok\":true"));
  ::close(client);
}

TEST(OrderSocket, OneWhoNeverReadsHoldsNobody) {
  const Served served(name_of_this_test());
  const int mute = connect_raw(served.path());
  const std::string order = Json{{"order", std::string(4000, 'x')}}.dump();
  for (int i = 0; i < 2000; ++i) {
    if (::send(mute, order.data(), order.size(), MSG_DONTWAIT | MSG_NOSIGNAL) < 0 && errno != EAGAIN) break;
  }
  EXPECT_TRUE(send_order(name_of_this_test(), {{"order", "state"}}));
  ::close(mute);
}

TEST(OrderSocket, OneThatIsNeverServedHoldsNoClient) {
  const std::string session = name_of_this_test();
  auto hangs = OrderSocket::open(session, [](const Json&) { return Json::object(); });
  ASSERT_TRUE(hangs) << hangs.error();
  // The queue of the listener fills up, since nobody accepts. Without an end to waiting the last of these never return.
  for (int i = 0; i < 40; ++i) {
    const auto reply = send_order(session, {{"order", "estop"}}, 0.02);
    ASSERT_FALSE(reply);
    EXPECT_THAT(reply.error(), HasSubstr("does not answer")) << i;
  }
  EXPECT_EQ(remove_dead_order_sockets(session), std::vector<std::string>{}) << "its owner lives";
}

TEST(OrderSocket, TakesTheNameOfADeadOne) {
  const std::string session = name_of_this_test();
  std::string path;
  {
    const Served served(session);
    path = served.path();
  }
  const int dead = ::socket(AF_UNIX, SOCK_SEQPACKET, 0);  // bound, never listening: what a killed process leaves
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  std::strncpy(address.sun_path, path.c_str(), sizeof address.sun_path - 1);
  ASSERT_EQ(::bind(dead, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  ::close(dead);
  EXPECT_THAT(remove_dead_order_sockets(session, true), testing::ElementsAre(path));
  {
    const Served served(session);
    EXPECT_TRUE(send_order(session, {{"order", "state"}}));
    EXPECT_THAT(remove_dead_order_sockets(session), testing::IsEmpty()) << "a live one stays";
  }
}

}  // namespace
}  // namespace tools
