#pragma once
/// @file view_fixture.hpp
/// Sessions, servers and tabs for the tests of `rtbus view`.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "tests/support/chromium.hpp"
#include "tests/support/nodes.hpp"
#include "tests/view/scripted_session.hpp"
#include "tests/view/view_server.hpp"

namespace tests {

/// All tests share one browser: it takes two seconds to start.
class View : public Nodes {
 protected:
  static void SetUpTestSuite() {
    if (!find_chromium().empty()) browser_ = std::make_unique<Chromium>();
  }
  static void TearDownTestSuite() { browser_.reset(); }
  void SetUp() override {
    Nodes::SetUp();
    if (browser_ == nullptr) {
      GTEST_SKIP() << "CHROMIUM IS NOT THERE: the page of rtbus view is not tested; install the package chromium";
    }
    browser_->forget_complaints();
  }
  void TearDown() override {
    scripted_.reset();
    if (browser_ != nullptr) {
      EXPECT_THAT(browser_->complaints(), testing::IsEmpty());
    }
    Nodes::TearDown();
  }

  /// A server for the scripted session.
  std::unique_ptr<ViewServer> scripted_server() {
    scripted_ = std::make_unique<ScriptedSession>(bus_.name);
    return std::make_unique<ViewServer>(
        bus_.name, std::vector<std::string>{"--config", std::string(RTBUS_SOURCE_DIR) + "/config/wall.yaml"});
  }
  void start_nodes(const std::string& file) {
    session_file_ = file;
    start_physics();
    start_haptic();
  }
  static void expect_ready(Tab& tab) {
    ASSERT_TRUE(tab.becomes("window.rtbusTest && rtbusTest.ready()", 30.0)) << tab.evaluate("document.body.innerText");
  }
  /// Keeps what a tab shows in RTBUS_SCREENS, to be looked at.
  static void keep(Tab& tab, const std::string& name) {
    const char* const folder = std::getenv("RTBUS_SCREENS");
    if (folder != nullptr) std::ofstream(std::string(folder) + "/" + name + ".base64") << tab.screenshot();
  }
  /// Colours of the picture at points, an expression in the page.
  static nlohmann::json colours(Tab& tab, const std::string& points) {
    return tab.evaluate("rtbusTest.colours(() => " + points + ")");
  }

  inline static std::unique_ptr<Chromium> browser_;
  std::unique_ptr<ScriptedSession> scripted_;
};

}  // namespace tests
