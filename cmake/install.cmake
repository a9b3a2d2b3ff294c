# What `cmake --install` installs, and where. Components: runtime (programs, sessions,
# pages), bridge (to ROS 2), clib (the C interface), python, dev (libraries, headers).
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

# --- runtime ---------------------------------------------------------------------------------------------------------
# Programs find each other and their modules in their own folder. `rtbus` alone is a command: a link to the one there.
# cpack would add calls of ldconfig for modules that lie right below lib/rtbus.
set(programs_dir lib/rtbus/bin)
set(programs rtbus rtbus_evaluation rtbus_view haptic_node physics_node simulated_plant)
set(modules physics_bullet physics_bullet_soft drivers_usb drivers_replay drivers_force_dimension drivers_openhaptics drivers_haply virtual_usb
  stand_in_force_dimension stand_in_openhaptics)
set(installed_targets)
foreach(target ${programs} ${modules})
  if(TARGET ${target})
    list(APPEND installed_targets ${target})
  endif()
endforeach()
install(TARGETS ${installed_targets} COMPONENT runtime
  RUNTIME DESTINATION ${programs_dir} LIBRARY DESTINATION ${programs_dir})
file(MAKE_DIRECTORY ${CMAKE_BINARY_DIR}/link)
file(CREATE_LINK ../${programs_dir}/rtbus ${CMAKE_BINARY_DIR}/link/rtbus SYMBOLIC)
install(FILES ${CMAKE_BINARY_DIR}/link/rtbus DESTINATION bin COMPONENT runtime)

install(DIRECTORY config/ DESTINATION ${CMAKE_INSTALL_DATADIR}/rtbus/config COMPONENT runtime
  PATTERN udev EXCLUDE PATTERN limits.d EXCLUDE)
install(FILES config/udev/70-rtbus-haptics.rules DESTINATION lib/udev/rules.d COMPONENT runtime)
# In a package this goes to /etc/security/limits.d (debian_staging.cmake); elsewhere an administrator copies it there.
install(FILES config/limits.d/rtbus.conf DESTINATION ${CMAKE_INSTALL_DATADIR}/rtbus/limits.d COMPONENT runtime)
install(FILES cmake/rtbus.bash_completion DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions
  RENAME rtbus COMPONENT runtime)

# Manual pages are what --help prints. The target installed_parts makes them; a build of everything goes without.
find_program(HELP2MAN_PROGRAM help2man)
if(TARGET rtbus_view)
  set(viewer rtbus_view)
endif()
if(TARGET rtbus_bridge)
  set(bridge rtbus_bridge rtbus_link dds_round_trip)
  install(TARGETS ${bridge} RUNTIME DESTINATION ${programs_dir} COMPONENT bridge)
endif()
if(HELP2MAN_PROGRAM AND TARGET rtbus_evaluation)
  add_custom_command(OUTPUT ${CMAKE_BINARY_DIR}/man/rtbus.1
    COMMAND ${PROJECT_SOURCE_DIR}/cmake/make_man_pages $<TARGET_FILE:rtbus> ${PROJECT_VERSION} ${CMAKE_BINARY_DIR}/man
    DEPENDS rtbus rtbus_evaluation ${viewer} ${bridge} cmake/make_man_pages VERBATIM)
  add_custom_target(man_pages DEPENDS ${CMAKE_BINARY_DIR}/man/rtbus.1)
  file(MAKE_DIRECTORY ${CMAKE_BINARY_DIR}/man)
  install(DIRECTORY ${CMAKE_BINARY_DIR}/man/ DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 COMPONENT runtime
    FILES_MATCHING PATTERN "*.1" PATTERN "rtbus-bridge.1" EXCLUDE PATTERN "rtbus-link.1" EXCLUDE)
  if(TARGET rtbus_bridge)
    install(FILES ${CMAKE_BINARY_DIR}/man/rtbus-bridge.1 ${CMAKE_BINARY_DIR}/man/rtbus-link.1 DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 COMPONENT bridge OPTIONAL)
  endif()
else()
  add_custom_target(man_pages)
  message(STATUS "help2man is not there (or the evaluation is left out): no manual pages")
endif()

# --- clib: the C interface --------------------------------------------------------------------------------------------
if(TARGET rtbus_c)
  set_target_properties(rtbus_c PROPERTIES EXPORT_NAME c)
  set_target_properties(rtbus_engine PROPERTIES EXPORT_NAME engine)
  install(TARGETS rtbus_c rtbus_engine EXPORT rtbus_c LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT clib NAMELINK_COMPONENT dev)
  install(FILES rtbus/c/rtbus.h ${RTBUS_C_GENERATED}/rtbus/c/rtbus_messages.h DESTINATION include/rtbus/rtbus/c COMPONENT dev)
  install(FILES physics_node/external/rtbus_engine.h DESTINATION include/rtbus COMPONENT dev)
endif()

# --- mujoco: the engine mujoco, a program of its own ------------------------------------------------------------------
if(TARGET mujoco_engine)
  install(TARGETS mujoco_engine RUNTIME DESTINATION ${programs_dir} COMPONENT mujoco)
endif()

# --- python ----------------------------------------------------------------------------------------------------------
if(TARGET rtbus_c)
  set(python_dir lib/python3/dist-packages)
  install(DIRECTORY rtbus/python/rtbus DESTINATION ${python_dir} COMPONENT python FILES_MATCHING PATTERN "*.py" PATTERN "py.typed")
  install(DIRECTORY docs/examples/python/ DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/python3-rtbus/examples COMPONENT python
    PATTERN __pycache__ EXCLUDE)
  install(FILES docs/python.md docs/your-own-physics.md DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/python3-rtbus COMPONENT python)
  # So that pip, and whoever asks for versions, find it.
  file(WRITE ${CMAKE_BINARY_DIR}/python/METADATA
       "Metadata-Version: 2.1\nName: rtbus\nVersion: ${PROJECT_VERSION}\nRequires-Dist: numpy\n")
  install(FILES ${CMAKE_BINARY_DIR}/python/METADATA DESTINATION ${python_dir}/rtbus-${PROJECT_VERSION}.dist-info COMPONENT python)
endif()

# --- dev -------------------------------------------------------------------------------------------------------------
# Headers go one folder down, so that /usr/include gets nothing called drivers/.
# Private headers stay here: those that need Boost, spdlog or Eigen, and those of single sources.
install(DIRECTORY rtbus DESTINATION include/rtbus COMPONENT dev FILES_MATCHING PATTERN "*.hpp"
  PATTERN command_line EXCLUDE PATTERN recording EXCLUDE PATTERN config/detail EXCLUDE
  PATTERN node_log.hpp EXCLUDE PATTERN eigen.hpp EXCLUDE PATTERN shm_object.hpp EXCLUDE PATTERN file.hpp EXCLUDE)
install(FILES drivers/device.hpp drivers/device_config.hpp drivers/driver_module.hpp DESTINATION include/rtbus/drivers COMPONENT dev)
# Between a driver's I/O thread and the loop.
install(FILES drivers/io/mailbox.hpp DESTINATION include/rtbus/drivers/io COMPONENT dev)

# rtbus::rtbus is the bus; rtbus::driver_sdk besides reads the YAML of a device, and needs yaml-cpp and Eigen.
add_library(rtbus_driver_sdk INTERFACE)
target_link_libraries(rtbus_driver_sdk INTERFACE rtbus_config)
set_target_properties(rtbus_bus PROPERTIES EXPORT_NAME rtbus)
set_target_properties(rtbus_compiler PROPERTIES EXPORT_NAME compiler)
set_target_properties(rtbus_config PROPERTIES EXPORT_NAME config)
set_target_properties(rtbus_shapes PROPERTIES EXPORT_NAME shapes)
set_target_properties(rtbus_driver_sdk PROPERTIES EXPORT_NAME driver_sdk)
set(package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/rtbus)
install(TARGETS rtbus_bus rtbus_compiler EXPORT rtbus_bus ARCHIVE COMPONENT dev)
install(TARGETS rtbus_config rtbus_shapes rtbus_driver_sdk EXPORT rtbus_driver_sdk ARCHIVE COMPONENT dev)
foreach(export rtbus_bus rtbus_driver_sdk rtbus_c)
  if(export STREQUAL rtbus_c AND NOT TARGET rtbus_c)
    continue()
  endif()
  install(EXPORT ${export} NAMESPACE rtbus:: DESTINATION ${package_dir} COMPONENT dev)
endforeach()
configure_package_config_file(cmake/rtbusConfig.cmake.in ${CMAKE_BINARY_DIR}/rtbusConfig.cmake
  INSTALL_DESTINATION ${package_dir} NO_SET_AND_CHECK_MACRO)
write_basic_package_version_file(${CMAKE_BINARY_DIR}/rtbusConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_BINARY_DIR}/rtbusConfig.cmake ${CMAKE_BINARY_DIR}/rtbusConfigVersion.cmake
  DESTINATION ${package_dir} COMPONENT dev)
install(DIRECTORY docs/examples DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/librtbus-dev COMPONENT dev)
install(FILES docs/writing-a-driver.md docs/shared-memory-layout.md
  DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/librtbus-dev COMPONENT dev)

# All that the two components install, and nothing else: no tests.
add_custom_target(installed_parts DEPENDS ${installed_targets} ${bridge} rtbus_bus rtbus_config rtbus_shapes man_pages)
if(TARGET rtbus_c)
  add_dependencies(installed_parts rtbus_c rtbus_engine)
  if(TARGET mujoco_engine)
    add_dependencies(installed_parts mujoco_engine)
  endif()
endif()
