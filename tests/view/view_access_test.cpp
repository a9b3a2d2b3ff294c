// Visitors of the viewer's server that should not come in, that want too much, or that do not listen.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <memory>

#include "tests/view/view_fixture.hpp"

namespace {

using testing::HasSubstr;
using tests::Tab;
using tests::View;
using tests::ViewServer;
using tests::Visitor;

TEST_F(View, RefusesStrangers) {
  const auto server = scripted_server();
  const std::string host = "Host: " + server->host() + "\r\n";
  EXPECT_THAT(Visitor::get(server->port(), "/", host), HasSubstr("200"));
  EXPECT_THAT(Visitor::get(server->port(), "/", "Host: evil.example\r\n"), HasSubstr("403"));
  EXPECT_THAT(Visitor::get(server->port(), "/", ""), testing::Not(HasSubstr("200")));
  EXPECT_THAT(Visitor::get(server->port(), "/../../etc/passwd", host), testing::Not(HasSubstr("200")));
  EXPECT_THAT(Visitor::get(server->port(), "/nothing.js", host), HasSubstr("404"));

  const std::string own = "http://" + server->host();
  EXPECT_THAT(Visitor(server->port()).upgrade(server->host(), own), HasSubstr("101"));
  EXPECT_THAT(Visitor(server->port()).upgrade(server->host(), ""), HasSubstr("101"));
  for (const std::string origin : {"http://evil.example", "http://127.0.0.1:1", "null"}) {
    EXPECT_THAT(Visitor(server->port()).upgrade(server->host(), origin), testing::Not(HasSubstr("101"))) << origin;
  }
  EXPECT_THAT(Visitor(server->port()).upgrade("evil.example", "http://evil.example"), testing::Not(HasSubstr("101")));

  Visitor wrong(server->port());
  EXPECT_THAT(wrong.upgrade(server->host(), own), HasSubstr("101"));
  EXPECT_TRUE(wrong.say(Visitor::text_frame(R"({"token":"00000000000000000000000000000000"})")));
  EXPECT_TRUE(wrong.ends());
  Visitor large(server->port());
  EXPECT_THAT(large.upgrade(server->host(), own), HasSubstr("101"));
  EXPECT_TRUE(large.say(Visitor::text_frame(R"({"token":")" + server->token() + "\"}")));
  (void)large.say(Visitor::text_frame(std::string(10U << 20U, ' ')));
  EXPECT_TRUE(large.ends());

  // A page with the wrong key says what to do, and does not try again.
  Tab tab(*browser_, 320, 240);
  tab.open("http://" + server->host() + "/#k=wrong");
  EXPECT_TRUE(tab.becomes("window.rtbusTest && rtbusTest.reason().includes('wrong key')"));
}

std::size_t resident_kib(pid_t pid) {
  std::ifstream in("/proc/" + std::to_string(pid) + "/status");
  for (std::string word; in >> word;) {
    if (word == "VmRSS:") {
      std::size_t kib = 0;
      in >> kib;
      return kib;
    }
  }
  return 0;
}

TEST_F(View, AVisitorThatNeverReadsHoldsNothing) {
  const auto server = scripted_server();
  std::vector<std::unique_ptr<Visitor>> deaf;
  for (int i = 0; i < 7; ++i) {
    deaf.push_back(std::make_unique<Visitor>(server->port()));
    EXPECT_THAT(deaf.back()->upgrade(server->host(), ""), HasSubstr("101"));
    EXPECT_TRUE(deaf.back()->say(Visitor::text_frame(R"({"token":")" + server->token() + "\"}")));
  }
  Tab tab(*browser_, 320, 240);
  tab.open(server->url());
  expect_ready(tab);
  const std::size_t before_kib = resident_kib(server->process().pid());
  const std::string more = "rtbusTest.frames() > 5 + " + tab.evaluate("rtbusTest.frames()").dump();
  (void)tab.becomes("false", 2.0);
  EXPECT_TRUE(tab.becomes(more));
  EXPECT_LT(resident_kib(server->process().pid()), before_kib + 4096);  // the history of the curves grows meanwhile
  // The ninth is turned away.
  Visitor ninth(server->port());
  EXPECT_THAT(ninth.upgrade(server->host(), ""), HasSubstr("101"));
  EXPECT_TRUE(ninth.ends());
}

TEST_F(View, SaysThatThePortIsInUse) {
  const ViewServer first(bus_.name);
  const std::string file = std::string(testing::TempDir()) + bus_.name + ".txt";
  tests::Child second({binary("rtbus"), "view", "--port", std::to_string(first.port())}, file);
  const int status = second.wait();
  EXPECT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), 1);
  std::ifstream in(file);
  std::string said;
  std::getline(in, said);
  EXPECT_THAT(said, HasSubstr("is in use"));
  ::unlink(file.c_str());
}

TEST_F(View, ASessionMapsNoWebLibrary) {
  start_nodes("wall.yaml");
  ASSERT_TRUE(reader<rtbus::DeviceState>("haptic0.device_state"));  // hz ends at once where there is no topic yet
  tests::Child run({binary("rtbus"), "hz", "haptic0.device_state", "--session", bus_.name}, "/dev/null");
  for (const pid_t pid : {physics_->pid(), haptic_->pid(), run.pid()}) {
    std::ifstream maps("/proc/" + std::to_string(pid) + "/maps");
    const std::string text((std::istreambuf_iterator<char>(maps)), std::istreambuf_iterator<char>());
    EXPECT_FALSE(text.empty());
    EXPECT_EQ(text.find("websockets"), std::string::npos);
  }
}

}  // namespace
