// The interface of external engines, as a program without our C++ sees it. No session runs: steps are due all the same.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdint>
#include <fstream>
#include <limits>
#include <string>
#include <utility>

#include "physics_node/external/rtbus_engine.h"
#include "tests/unit/c_api/exported.hpp"

extern "C" size_t rtbus_engine_abi_checked(void);

namespace {

using testing::HasSubstr;

const std::string kSource = RTBUS_SOURCE_DIR;

TEST(EngineAbi, ExportsExactlyThePinnedSymbols) {
  EXPECT_EQ(tests::exported_by(RTBUS_ENGINE_LIBRARY, "RTBUS_ENGINE_1"),
            tests::lines_of(kSource + "/tests/unit/c_api/engine_symbols.txt"));
  EXPECT_EQ(rtbus_engine_abi_checked(), sizeof(rtbus_engine_hand));
  EXPECT_EQ(rtbus_engine_abi_version(), static_cast<std::uint32_t>(RTBUS_ENGINE_ABI_VERSION));
}

TEST(CInterfaces, SayOfEachFunctionFromWhichThreadItMayBeCalled) {
  for (const auto& [path, macro] : {std::pair{"/rtbus/c/rtbus.h", "RTBUS_API "},
                                    std::pair{"/physics_node/external/rtbus_engine.h", "RTBUS_ENGINE_API "}}) {
    std::ifstream file(kSource + path);
    int functions = 0;
    std::string before;
    for (std::string line; std::getline(file, line); before = line) {
      if (!line.starts_with(macro)) continue;
      ++functions;
      EXPECT_THAT(before, HasSubstr("@thread ")) << line;
    }
    EXPECT_GT(functions, 10) << path;
  }
}

template <class T>
T sized() {
  T out{};
  out.struct_bytes = sizeof out;
  return out;
}

class EngineApi : public testing::Test {
 protected:
  EngineApi() {
    static int count = 0;
    set_ = "session=engine-api-" + std::to_string(::getpid()) + "-" + std::to_string(++count);
    options_.config = file_.c_str();
    options_.set = set_.c_str();
    options_.gives = RTBUS_GIVES_BODIES;
    options_.bodies = 2;
  }
  ~EngineApi() override { rtbus_engine_close(engine_); }

  void begin() {
    ASSERT_EQ(rtbus_engine_open(&options_, &engine_), RTBUS_ENGINE_OK) << rtbus_engine_last_error();
    auto step = sized<rtbus_engine_step>();
    while (step.due == 0) ASSERT_EQ(rtbus_engine_begin(engine_, &step), RTBUS_ENGINE_OK) << rtbus_engine_last_error();
  }
  static rtbus_engine_body body() {
    auto out = sized<rtbus_engine_body>();
    out.kind = RTBUS_BODY_DYNAMIC;
    out.mass_kg = 1.0;
    for (double& moment : out.inertia_kg_m2) moment = 1e-3;
    return out;
  }
  static rtbus_engine_contact contact() {
    auto out = sized<rtbus_engine_contact>();
    out.body = 1;
    out.normal[1] = 1.0;
    return out;
  }
  static rtbus_engine_support support() {
    auto out = sized<rtbus_engine_support>();
    out.normal[1] = out.force_n = 1.0;
    return out;
  }
  void refused(int status, const std::string& sentence) {
    EXPECT_EQ(status, RTBUS_ENGINE_E_VALUE) << sentence;
    EXPECT_THAT(rtbus_engine_last_error(), HasSubstr(sentence));
  }

  std::string file_ = kSource + "/docs/examples/python/python_wall.yaml", set_;
  rtbus_engine_options options_ = sized<rtbus_engine_options>();
  rtbus_engine* engine_ = nullptr;
};

TEST_F(EngineApi, RefusesANegativeMassOrFrictionByTheFieldsName) {
  begin();
  auto wrong = body();
  ASSERT_EQ(rtbus_engine_set_body(engine_, 0, &wrong), RTBUS_ENGINE_OK) << rtbus_engine_last_error();
  wrong.mass_kg = -1.0;
  refused(rtbus_engine_set_body(engine_, 0, &wrong), "body 0: mass_kg = -1.000000 is negative");
  wrong.kind = RTBUS_BODY_STATIC;
  refused(rtbus_engine_set_body(engine_, 0, &wrong), "body 0: mass_kg = -1.000000 is negative");
  wrong = body();
  wrong.inertia_kg_m2[2] = -1e-3;
  refused(rtbus_engine_set_body(engine_, 0, &wrong), "body 0: inertia_kg_m2[2] = -0.001000 is negative");
  wrong = body();
  wrong.friction_bound_n = -0.5;
  refused(rtbus_engine_set_body(engine_, 0, &wrong), "body 0: friction_bound_n = -0.500000 is negative");

  auto near = contact();
  ASSERT_EQ(rtbus_engine_add_contact(engine_, 0, &near), RTBUS_ENGINE_OK) << rtbus_engine_last_error();
  near.friction = -0.1;
  refused(rtbus_engine_add_contact(engine_, 0, &near), "contact: friction = -0.100000 is negative");

  auto holds = support();
  ASSERT_EQ(rtbus_engine_add_support(engine_, &holds), RTBUS_ENGINE_OK) << rtbus_engine_last_error();
  holds.friction = -0.1;
  refused(rtbus_engine_add_support(engine_, &holds), "support: friction = -0.100000 is negative");
  holds = support();
  holds.inverse_mass_per_kg = -1.0;
  refused(rtbus_engine_add_support(engine_, &holds), "support: inverse_mass_per_kg = -1.000000 is negative");
  holds = support();
  holds.force_n = -1.0;
  refused(rtbus_engine_add_support(engine_, &holds), "support: force_n must be above 0");
}

TEST_F(EngineApi, RefusesWhatIsNotFiniteOrDoesNotExistByTheFieldsName) {
  begin();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  auto tool = sized<rtbus_engine_tool>();
  tool.velocity_m_s[2] = nan;
  refused(rtbus_engine_set_tool(engine_, 0, &tool), "hand haptic0: tool.velocity_m_s[2] = nan is not finite");
  tool = sized<rtbus_engine_tool>();
  tool.position_m[0] = 1e9;
  refused(rtbus_engine_set_tool(engine_, 0, &tool), "tool.position_m[0] = 1000000000.000000 is impossible");
  tool = sized<rtbus_engine_tool>();
  tool.orientation_wxyz[0] = 2.0;
  refused(rtbus_engine_set_tool(engine_, 0, &tool), "tool.orientation_wxyz has the length 2");
  auto moved = body();
  moved.external_torque_n_m[1] = nan;
  refused(rtbus_engine_set_body(engine_, 1, &moved), "body 1: external_torque_n_m[1] = nan is not finite");
  moved = body();
  moved.kind = 9;
  refused(rtbus_engine_set_body(engine_, 1, &moved), "body 1: kind = 9 is unknown");
  moved = body();
  refused(rtbus_engine_set_body(engine_, 2, &moved), "body = 2 does not exist; this session has 2 (0…1)");
  auto near = contact();
  near.body = 5;
  refused(rtbus_engine_add_contact(engine_, 0, &near), "contact: body = 5 does not exist");
  near = contact();
  near.gap_m = nan;
  refused(rtbus_engine_add_contact(engine_, 0, &near), "contact: gap_m = nan is not finite");
  near = contact();
  near.normal[1] = 0.0;
  refused(rtbus_engine_add_contact(engine_, 0, &near), "contact: normal has the length 0");
  auto shape = sized<rtbus_engine_shape>();
  shape.kind = RTBUS_SHAPE_SPHERE;
  refused(rtbus_engine_add_shape(engine_, 0, &shape), "shape: size_m[0] must be above 0");
}

TEST_F(EngineApi, TwoEnginesAtOnceAreRefused) {
  begin();
  rtbus_engine* second = nullptr;
  EXPECT_EQ(rtbus_engine_open(&options_, &second), RTBUS_ENGINE_E_OWNED);
  EXPECT_EQ(second, nullptr);
  EXPECT_THAT(rtbus_engine_last_error(), HasSubstr("a live writer holds this topic"));
}

TEST_F(EngineApi, CallsThatMakeNoSenseSayWhy) {
  rtbus_engine* none = nullptr;
  options_.config = "/nothing/here.yaml";
  EXPECT_EQ(rtbus_engine_open(&options_, &none), RTBUS_ENGINE_E_CONFIG);
  EXPECT_THAT(rtbus_engine_last_error(), HasSubstr("/nothing/here.yaml"));
  EXPECT_EQ(rtbus_engine_open(&options_, nullptr), RTBUS_ENGINE_E_ARGUMENT);
  options_.config = file_.c_str();
  ASSERT_EQ(rtbus_engine_open(&options_, &engine_), RTBUS_ENGINE_OK) << rtbus_engine_last_error();
  const auto moved = body();
  EXPECT_EQ(rtbus_engine_set_body(engine_, 0, &moved), RTBUS_ENGINE_E_ORDER);
  EXPECT_THAT(rtbus_engine_last_error(), HasSubstr("rtbus_engine_begin()"));
  EXPECT_EQ(rtbus_engine_finish(engine_), RTBUS_ENGINE_E_ORDER);
  const auto tool = sized<rtbus_engine_tool>();
  EXPECT_EQ(rtbus_engine_set_tool(engine_, 7, &tool), RTBUS_ENGINE_E_ARGUMENT);
  EXPECT_THAT(rtbus_engine_last_error(), HasSubstr("there is no hand 7"));
  const rtbus_engine_tool without_size{};
  EXPECT_EQ(rtbus_engine_set_tool(engine_, 0, &without_size), RTBUS_ENGINE_E_ARGUMENT);
  EXPECT_THAT(rtbus_engine_last_error(), HasSubstr("struct_bytes"));
}

}  // namespace
