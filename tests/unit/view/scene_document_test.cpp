// A scene as the page gets it.
#include "tools/view/scene_document.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>

#include "tools/view/protocol.hpp"

namespace {

using rtbus::config::Body;
using rtbus::config::Scene;
using rtbus::config::TriangleMesh;

Body body(const std::string& name, rtbus::config::BodyShape shape) {
  Body out;
  out.name = name;
  out.shape = std::move(shape);
  return out;
}

std::shared_ptr<TriangleMesh> mesh(std::size_t triangles) {
  auto out = std::make_shared<TriangleMesh>();
  out->file = "hand.obj";
  out->vertices_m = {{0, 0, 0}, {0.2, 0, 0}, {0, 0.4, 0.1}};
  out->triangles.assign(triangles, {0, 1, 2});
  return out;
}

TEST(ViewScene, PutsRowsOfOneShapeTogether) {
  Scene scene;
  scene.bodies = {body("a", rtbus::shapes::Sphere{0.1}), body("b", rtbus::shapes::Box{{1, 2, 3}}),
                  body("c", rtbus::shapes::Sphere{0.2}), body("d", rtbus::shapes::Box{{1, 2, 3}})};
  const view::ViewScene out = view::make_view_scene(scene, "s", {});
  EXPECT_THAT(out.order, testing::ElementsAre(1, 3, 0, 2));
  EXPECT_EQ(out.document["bodies"][0]["name"], "b");
  EXPECT_EQ(out.document["shapes"].size(), 3U);  // equal boxes once
  EXPECT_EQ(out.document["bodies"][0]["shape"], out.document["bodies"][1]["shape"]);
}

TEST(ViewScene, SendsEachMeshOnce) {
  const auto shared = mesh(4);
  Scene scene;
  scene.bodies = {body("a", rtbus::config::Mesh{shared}), body("b", rtbus::config::ConvexHull{shared})};
  const view::ViewScene out = view::make_view_scene(scene, "s", {});
  EXPECT_EQ(out.meshes.size(), 1U);
  EXPECT_EQ(out.document["notes"].size(), 0U);
}

TEST(ViewScene, ShowsTheBoxOfAMeshThatIsTooLarge) {
  Scene scene;
  scene.bodies = {body("a", rtbus::config::Mesh{mesh(view::kMostTriangles + 1)}),
                  body("b", rtbus::config::ConvexHull{mesh(0)})};
  const view::ViewScene out = view::make_view_scene(scene, "s", {});
  EXPECT_TRUE(out.meshes.empty());
  EXPECT_EQ(out.document["shapes"][0]["kind"], "bounds");
  EXPECT_DOUBLE_EQ(out.document["shapes"][0]["half"][1].get<double>(), 0.2);
  EXPECT_DOUBLE_EQ(out.document["shapes"][0]["middle"][0].get<double>(), 0.1);
  ASSERT_EQ(out.document["notes"].size(), 2U);
  EXPECT_THAT(out.document["notes"][0].get<std::string>(), testing::HasSubstr("200001 triangles"));
  EXPECT_THAT(out.document["notes"][1].get<std::string>(), testing::HasSubstr("no faces"));
}

}  // namespace
