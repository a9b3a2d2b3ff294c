// Keys that the device files of all vendors' devices have in common.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <string_view>
#include <vector>

#include "drivers/force_dimension/models.hpp"
#include "drivers/openhaptics/models.hpp"
#include "drivers/vendor/device_keys.hpp"
#include "tests/unit/vendor/desk.hpp"

namespace drivers::vendor {
namespace {

using ::testing::HasSubstr;
using ::testing::UnorderedElementsAreArray;
using tests::problem_of;

template <class Models>
std::vector<std::string_view> names_of(const Models& models) {
  std::vector<std::string_view> out;
  for (const auto& model : models) out.push_back(model.name);
  return out;
}

TEST(Model, OfAnotherVendorNamesItsDriver) {
  EXPECT_THAT(
      problem_of("{schema: device/1, driver: openhaptics, model: omega3}"),
      HasSubstr("model = \"omega3\" is a device of driver: force_dimension; set that driver, or choose touch, "));
  EXPECT_THAT(problem_of("{schema: device/1, driver: force_dimension, model: inverse3}"),
              HasSubstr("model = \"inverse3\" is a device of driver: haply; set that driver, or choose omega3, "));
  EXPECT_THAT(problem_of("{schema: device/1, driver: force_dimension, model: toaster}"),
              HasSubstr("model = \"toaster\" is not known"));
}

TEST(Model, TheListsAreThoseOfTheDrivers) {
  for (const DriverModels& each : models_of_vendors()) {
    if (each.driver == "force_dimension") {
      EXPECT_THAT(each.models, UnorderedElementsAreArray(names_of(force_dimension::models())));
    } else if (each.driver == "openhaptics") {
      EXPECT_THAT(each.models, UnorderedElementsAreArray(names_of(openhaptics::models())));
    }
  }
}

}  // namespace
}  // namespace drivers::vendor
