#include "physics_node/engine_registry.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace {

using rtbus::config::Body;
using rtbus::config::BodyType;
using rtbus::config::Error;
using rtbus::config::Scene;
using testing::AllOf;
using testing::HasSubstr;

Scene scene_with(BodyType type) {
  Scene scene;
  scene.file = "scenes/peg.yaml";
  Body body;
  body.name = "peg";
  body.type = type;
  body.shape = rtbus::shapes::Sphere{0.01};
  scene.bodies.push_back(body);
  return scene;
}

std::string message_of(std::string_view engine, const Scene& scene) {
  try {
    (void)physics::make_world(engine, scene);
  } catch (const Error& error) {
    return error.what();
  }
  return {};
}

TEST(EngineRegistry, MakesTheAnalyticWorldOfAScene) {
  const auto world = physics::make_world("analytic", scene_with(BodyType::kStatic));
  EXPECT_EQ(world->bodies(), 1U);
}

TEST(EngineRegistry, ListsTheEnginesWhenAskedForAnUnknownOne) {
  EXPECT_THAT(message_of("bulet", Scene{}), AllOf(HasSubstr("bulet"), HasSubstr("analytic")));
}

TEST(EngineRegistry, NamesTheBodyThatAnalyticCannotMove) {
  constexpr auto kMoving = static_cast<BodyType>(1);  // a type that only other engines know
  EXPECT_THAT(message_of("analytic", scene_with(kMoving)),
              AllOf(HasSubstr("scenes/peg.yaml"), HasSubstr("body peg moves")));
}

TEST(EngineRegistry, DescribesEveryRow) {
  for (const physics::EngineEntry& entry : physics::registered_engines()) {
    EXPECT_EQ(physics::find_engine(entry.name), &entry);
    EXPECT_FALSE(entry.description.empty());
    EXPECT_NE(entry.factory, nullptr);
    EXPECT_LT(entry.left_out.size(), 256U);  // NodeInfo::left_out
    EXPECT_LT(entry.name.size(), 32U);       // NodeInfo::kind
  }
}

}  // namespace
