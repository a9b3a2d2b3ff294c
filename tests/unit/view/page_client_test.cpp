// What a page gets and when, without sockets.
#include "tools/view/page_client.hpp"

#include <gtest/gtest.h>

#include "rtbus/clock.hpp"
#include "tools/view/server.hpp"

namespace {

using namespace view;

constexpr const char* kToken = "0123456789abcdef0123456789abcdef";
constexpr std::uint64_t kStart_ns = 1000 * rtbus::kNsPerS;

class Source final : public FrameSource {
 public:
  Source() {
    scene_.number = 1;
    scene_.document = {{"type", "scene"}};
    state_.set({{"type", "state"}});
    figures_.set({{"type", "figures"}});
    frame_.number = 1;
  }
  void follow() override { ++frame_.number; }
  std::string session() const override { return "none"; }
  const ViewScene* scene() const override { return &scene_; }
  const ViewFrame& frame() const override { return frame_; }
  const Document& state() const override { return state_; }
  const Document& figures() const override { return figures_; }

  ViewScene scene_;
  ViewFrame frame_;
  Document state_, figures_;
};

class Page : public testing::Test {
 protected:
  void welcome() { client_.receive(std::string(R"({"token":")") + kToken + "\"}", nullptr, kStart_ns); }
  void acknowledge(std::uint64_t frame) {
    client_.receive("{\"ack\":" + std::to_string(frame) + "}", nullptr, kStart_ns);
  }
  /// "hello", "state", …, "frame"; "": nothing.
  std::string next(const FrameSource* source) {
    EXPECT_EQ(client_.wants(source), !Page::peek_empty(source));
    const auto out = client_.next(source, kStart_ns);
    if (!out) return "";
    if (out->binary) return "frame";
    return nlohmann::json::parse(out->bytes.begin() + kMessageRoom, out->bytes.end())["type"].get<std::string>();
  }
  /// next() of a copy has nothing.
  bool peek_empty(const FrameSource* source) const {
    PageClient copy = client_;
    return !copy.next(source, kStart_ns);
  }

  static OrderOptions read_only() {
    OrderOptions out;
    out.read_only = true;
    return out;
  }
  SessionOrders orders_{read_only()};
  PageClient client_{kToken, orders_, kStart_ns};
  Source source_;
};

TEST_F(Page, GetsNothingBeforeItsToken) {
  EXPECT_EQ(next(&source_), "");
  client_.check_patience(kStart_ns + 11 * rtbus::kNsPerS);
  EXPECT_EQ(client_.refusal(), Refusal::kNoToken);
}

TEST_F(Page, IsTurnedAwayWithAWrongOne) {
  client_.receive(R"({"token":"0123456789abcdef0123456789abcdee"})", nullptr, kStart_ns);
  EXPECT_EQ(client_.refusal(), Refusal::kWrongToken);
  welcome();
  EXPECT_EQ(client_.refusal(), Refusal::kWrongToken);
}

TEST_F(Page, GetsAtMostTwoFramesThatItHasNotAcknowledged) {
  welcome();
  for (const char* const each : {"hello", "state", "scene", "figures", "frame"}) EXPECT_EQ(next(&source_), each);
  EXPECT_EQ(next(&source_), "");  // nothing new
  source_.follow();
  EXPECT_EQ(next(&source_), "frame");
  source_.follow();
  EXPECT_EQ(next(&source_), "");  // two are under way
  source_.state_.set({{"type", "state"}, {"word", "LOST"}});
  EXPECT_EQ(next(&source_), "state");  // this one does not wait
  acknowledge(1);
  EXPECT_EQ(next(&source_), "frame");
  EXPECT_EQ(next(&source_), "");
  acknowledge(3);
  source_.follow();
  EXPECT_EQ(next(&source_), "frame");
}

TEST_F(Page, GetsEverythingOfANewSource) {
  welcome();
  for (int i = 0; i < 5; ++i) (void)next(&source_);
  EXPECT_EQ(next(nullptr), "");
  acknowledge(1);
  const Source other;
  for (const char* const each : {"state", "scene", "figures", "frame"}) EXPECT_EQ(next(&other), each);
}

TEST_F(Page, IsTurnedAwayForNonsense) {
  for (const std::string text : {"", "[]", "{", "{\"ack\":-1}", "{\"ack\":5}", "{\"ack\":\"1\"}", "{}", "\xff\xfe"}) {
    PageClient client(kToken, orders_, kStart_ns);
    client.receive(std::string(R"({"token":")") + kToken + "\"}", nullptr, kStart_ns);
    client.receive(text, nullptr, kStart_ns);
    EXPECT_EQ(client.refusal(), Refusal::kBadMessage) << text;
  }
}

TEST_F(Page, IsTurnedAwayForTooMuch) {
  welcome();
  for (int i = 0; i < ServerLimits::kMessages_per_s; ++i) acknowledge(0);
  EXPECT_EQ(client_.refusal(), Refusal::kTooMany);
}

TEST_F(Page, LooksWhileItAcknowledges) {
  EXPECT_FALSE(client_.looks(kStart_ns));
  welcome();
  EXPECT_TRUE(client_.looks(kStart_ns + 4 * rtbus::kNsPerS));
  EXPECT_FALSE(client_.looks(kStart_ns + 6 * rtbus::kNsPerS));
}

TEST_F(Page, OrdersAreRefusedWithTheReason) {
  welcome();
  EXPECT_EQ(next(nullptr), "hello");
  client_.receive(R"({"order":{"order":"rearm"}})", nullptr, kStart_ns);
  const auto out = client_.next(nullptr, kStart_ns);
  ASSERT_TRUE(out);
  const auto answer = nlohmann::json::parse(out->bytes.begin() + kMessageRoom, out->bytes.end());
  EXPECT_EQ(answer["taken"], false);
  EXPECT_NE(answer["text"].get<std::string>().find("--read-only"), std::string::npos);
}

TEST_F(Page, APageThatOnlyOrdersHoldsNothing) {
  welcome();
  EXPECT_EQ(next(nullptr), "hello");
  for (int i = 0; i < 100; ++i) client_.receive(R"({"order":{"order":"mark"}})", nullptr, kStart_ns);
  int answers = 0;
  while (client_.next(nullptr, kStart_ns)) ++answers;
  EXPECT_EQ(answers, 16);
}

}  // namespace
