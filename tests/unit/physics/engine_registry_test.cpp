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
  body.source = "scenes/peg.yaml:4: bodies.0";
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
  EXPECT_EQ(
      message_of("analytic", scene_with(BodyType::kDynamic)),
      "scenes/peg.yaml:4: bodies.0.type = dynamic: body peg moves, which physics.engine = analytic cannot do; make "
      "it static or write engine: bullet");
}

TEST(EngineRegistry, ChecksASceneWithoutMakingAWorld) {
  EXPECT_NO_THROW(physics::check_scene("analytic", scene_with(BodyType::kStatic)));
  EXPECT_NO_THROW(physics::check_scene("bullet", scene_with(BodyType::kDynamic)));
  EXPECT_THROW(physics::check_scene("analytic", scene_with(BodyType::kKinematic)), Error);
}

TEST(EngineRegistry, NamesTheBodyWhoseShapeOrBounceAnalyticDoesNotKnow) {
  Scene scene = scene_with(BodyType::kStatic);
  scene.bodies[0].shape = rtbus::config::Cylinder{0.01, 0.02};
  EXPECT_THAT(message_of("analytic", scene), AllOf(HasSubstr("body peg is a cylinder"), HasSubstr("engine: bullet")));
  scene = scene_with(BodyType::kStatic);
  scene.bodies[0].restitution = 0.5;
  EXPECT_THAT(message_of("analytic", scene),
              AllOf(HasSubstr("body peg has a restitution"), HasSubstr("engine: bullet")));
}

// Without this, a build that loses its module would only skip tests.
TEST(EngineRegistry, BuildsWhatItPromises) {
  EXPECT_TRUE(physics::engine_present(*physics::find_engine("analytic")));
  EXPECT_EQ(physics::engine_present(*physics::find_engine("bullet")), RTBUS_WITH_BULLET != 0);
  if (RTBUS_WITH_BULLET == 0) {
    EXPECT_THAT(message_of("bullet", scene_with(BodyType::kStatic)),
                AllOf(HasSubstr("libphysics_bullet.so"), HasSubstr("libbullet-dev")));
  }
}

TEST(EngineRegistry, SaysWhereItLookedForAMissingModule) {
  const physics::EngineEntry lost{"lost", "", "", "libphysics_lost.so", nullptr};
  EXPECT_FALSE(physics::engine_present(lost));
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
