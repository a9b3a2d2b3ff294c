# Run by cpack between installing and packing: what Debian wants and an installation elsewhere does not need.
string(TIMESTAMP now "%a, %d %b %Y %H:%M:%S +0000" UTC)
string(TIMESTAMP year "%Y" UTC)
foreach(package ${CPACK_COMPONENTS_ALL})
  set(root ${CPACK_TEMPORARY_DIRECTORY}/${package})
  string(TOUPPER ${package} component)
  set(name ${CPACK_DEBIAN_${component}_PACKAGE_NAME})
  set(doc ${root}/usr/share/doc/${name})

  configure_file(${CMAKE_CURRENT_LIST_DIR}/copyright.in ${doc}/copyright @ONLY)
  file(WRITE ${doc}/changelog "${name} (${CPACK_PACKAGE_VERSION}) unstable; urgency=medium

  * Release ${CPACK_PACKAGE_VERSION}; CHANGELOG.md of the sources says what is new.

 -- ${CPACK_PACKAGE_CONTACT}  ${now}
")
  file(GLOB pages ${root}/usr/share/man/man1/*.1)
  execute_process(COMMAND gzip -9n ${doc}/changelog ${pages} COMMAND_ERROR_IS_FATAL ANY)
  file(GLOB archives ${root}/usr/lib/*.a ${root}/usr/lib/*/*.a)
  foreach(archive ${archives})  # cpack strips programs only
    execute_process(COMMAND strip --strip-debug --enable-deterministic-archives ${archive} COMMAND_ERROR_IS_FATAL ANY)
  endforeach()
endforeach()

set(root ${CPACK_TEMPORARY_DIRECTORY}/runtime)
file(MAKE_DIRECTORY ${root}/etc/security)
file(RENAME ${root}/usr/share/rtbus/limits.d ${root}/etc/security/limits.d)
