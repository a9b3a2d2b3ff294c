# Third-party packages, all from Debian 12 / Ubuntu 22.04 (tools/install_packages lists them).
find_package(Threads REQUIRED)
find_package(Boost 1.74 REQUIRED)          # Interprocess: headers only
find_package(yaml-cpp REQUIRED)
find_package(spdlog REQUIRED)
find_package(Eigen3 3.4 REQUIRED NO_MODULE)
find_package(CLI11 REQUIRED)
if(RTBUS_BUILD_TOOLS)
  find_package(nlohmann_json REQUIRED)
  set(CURSES_NEED_WIDE TRUE)
  find_package(Curses REQUIRED)
endif()
if(RTBUS_BUILD_TESTS)
  find_package(GTest REQUIRED)
endif()
if(NOT TARGET yaml-cpp::yaml-cpp)           # older packages export the bare name only
  add_library(yaml-cpp::yaml-cpp ALIAS yaml-cpp)
endif()
