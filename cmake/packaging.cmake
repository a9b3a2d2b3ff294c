# Debian packages of the components: rtbus, rtbus-bridge, rtbus-mujoco, librtbus1, python3-rtbus and librtbus-dev. `tools/build_package` runs cpack with this.
set(RTBUS_PACKAGER "rtbus developers <rtbus@localhost>" CACHE STRING "Who makes the packages: Name <address>")
set(CPACK_VERBATIM_VARIABLES ON)
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME rtbus)
set(CPACK_PACKAGE_CONTACT ${RTBUS_PACKAGER})
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_OUTPUT_FILE_PREFIX ${CMAKE_BINARY_DIR}/packages)
set(CPACK_COMPONENTS_ALL runtime dev)
if(RTBUS_BUILD_C_API)
  list(APPEND CPACK_COMPONENTS_ALL clib python)
endif()
if(TARGET mujoco_engine)
  list(APPEND CPACK_COMPONENTS_ALL mujoco)
endif()
if(TARGET rtbus_bridge)
  list(APPEND CPACK_COMPONENTS_ALL bridge)
endif()
set(CPACK_COMPONENTS_GROUPING IGNORE)  # one package per component
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_STRIP_FILES ON)
set(CPACK_INSTALL_DEFAULT_DIRECTORY_PERMISSIONS  # whatever the umask
  OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE)
set(CPACK_PRE_BUILD_SCRIPTS ${CMAKE_CURRENT_LIST_DIR}/debian_staging.cmake)

set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_RUNTIME_PACKAGE_NAME rtbus)
set(CPACK_DEBIAN_RUNTIME_PACKAGE_SECTION science)
set(CPACK_DEBIAN_RUNTIME_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_RUNTIME_PACKAGE_RECOMMENDS "gnuplot-nox, povray, fonts-dejavu-core")
set(CPACK_DEBIAN_RUNTIME_PACKAGE_CONTROL_EXTRA ${CMAKE_CURRENT_LIST_DIR}/conffiles)
set(CPACK_COMPONENT_RUNTIME_DESCRIPTION "A haptic device needs a new force every millisecond. A physics engine needs
longer for a step. The two run as processes of their own, joined by lock-free
shared memory, and the hand stays safe when physics stalls or crashes.
.
This package has the command rtbus with its nodes, drivers for the Novint
Falcon and for PHANToM-class arms over USB, simulated devices, and sessions
that run without hardware: try \"rtbus run wall --duration 5\".")

set(CPACK_DEBIAN_CLIB_PACKAGE_NAME librtbus1)
set(CPACK_DEBIAN_CLIB_PACKAGE_SECTION libs)
set(CPACK_DEBIAN_CLIB_PACKAGE_SHLIBDEPS ON)
set(control ${CMAKE_BINARY_DIR}/librtbus1.control)
file(WRITE ${control}/shlibs "librtbus 1 librtbus1 (>= ${PROJECT_VERSION})\nlibrtbus_engine 1 librtbus1 (>= ${PROJECT_VERSION})\n")
file(WRITE ${control}/triggers "activate-noawait ldconfig\n")
set(CPACK_DEBIAN_CLIB_PACKAGE_CONTROL_EXTRA ${control}/shlibs ${control}/triggers)
set(CPACK_COMPONENT_CLIB_DESCRIPTION "Reads and writes the topics of rtbus sessions, from C and from whatever calls
C: a topic is a ring of samples in POSIX shared memory with one writer and any
number of readers, and describes its fields itself.")

set(CPACK_DEBIAN_PYTHON_PACKAGE_NAME python3-rtbus)
set(CPACK_DEBIAN_PYTHON_PACKAGE_SECTION python)
set(CPACK_DEBIAN_PYTHON_PACKAGE_ARCHITECTURE all)
set(CPACK_DEBIAN_PYTHON_PACKAGE_DEPENDS "python3 (>= 3.9), python3-numpy, librtbus1 (>= ${PROJECT_VERSION})")
set(CPACK_DEBIAN_PYTHON_PACKAGE_RECOMMENDS "rtbus, python3-h5py, python3-matplotlib")
set(CPACK_COMPONENT_PYTHON_DESCRIPTION "Topics of rtbus sessions as numpy structured arrays: the newest sample, all of
them in order, publishing, recordings, orders. Needs nothing compiled beside
librtbus1.")

set(CPACK_DEBIAN_MUJOCO_PACKAGE_NAME rtbus-mujoco)
set(CPACK_DEBIAN_MUJOCO_PACKAGE_SECTION science)
set(CPACK_DEBIAN_MUJOCO_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_MUJOCO_PACKAGE_DEPENDS "rtbus (= ${PROJECT_VERSION}), librtbus1 (= ${PROJECT_VERSION})")
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS_PRIVATE_DIRS ${CMAKE_BINARY_DIR}/lib)  # librtbus_engine, of librtbus1
set(CPACK_COMPONENT_MUJOCO_DESCRIPTION "The engine mujoco of rtbus: sessions with physics: {engine: mujoco} are
simulated by MuJoCo, in a program of its own. Try \"rtbus run block_mujoco\".")

set(CPACK_DEBIAN_BRIDGE_PACKAGE_NAME rtbus-bridge)
set(CPACK_DEBIAN_BRIDGE_PACKAGE_SECTION science)
set(CPACK_DEBIAN_BRIDGE_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_BRIDGE_PACKAGE_DEPENDS "rtbus (= ${PROJECT_VERSION})")
set(CPACK_DEBIAN_BRIDGE_PACKAGE_SUGGESTS "iproute2")
set(CPACK_COMPONENT_BRIDGE_DESCRIPTION "Shows rtbus sessions to ROS 2, over DDS and without ROS 2: poses, twists,
wrenches, buttons, joint states, /tf and /diagnostics, under the names and
types that ROS 2 has for them. Sessions with \"bridge:\" start it.")

set(CPACK_DEBIAN_DEV_PACKAGE_NAME librtbus-dev)
set(CPACK_DEBIAN_DEV_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_DEV_PACKAGE_SHLIBDEPS ON)  # of driver_conformance
set(CPACK_DEBIAN_DEV_PACKAGE_RECOMMENDS "libyaml-cpp-dev, libeigen3-dev")
set(CPACK_DEBIAN_DEV_PACKAGE_SUGGESTS rtbus)
if(RTBUS_BUILD_C_API)
  set(CPACK_DEBIAN_DEV_PACKAGE_DEPENDS "librtbus1 (= ${PROJECT_VERSION})")
endif()
set(CPACK_COMPONENT_DEV_DESCRIPTION "Reads and writes the topics of rtbus sessions from C++20 programs: a topic is
a ring of samples in POSIX shared memory with one writer and any number of
readers, no locks, and no system call in a realtime thread.
.
find_package(rtbus CONFIG) in CMake gives the target rtbus::rtbus. With the
component driver_sdk it gives what a device driver is written against.")
include(CPack)
