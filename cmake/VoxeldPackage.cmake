# What `cmake --install` installs, and the Debian package (cpack --preset release) that is made of it. The paths in
# packaging/ are those of the prefix /usr.
include(GNUInstallDirs)
set(VOXELD_MAINTAINER "voxeld maintainers <maintainers@voxeld.invalid>" CACHE STRING "Maintainer of the package")

set(doc ${CMAKE_INSTALL_DATADIR}/doc/voxeld)
set(packaging ${CMAKE_SOURCE_DIR}/packaging)
install(TARGETS voxeld voxelctl RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
# Not of the package, which would depend on ROS: cmake --install BUILD --component ros
if(TARGET voxeld-ros)
  install(TARGETS voxeld-ros RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT ros EXCLUDE_FROM_ALL)
endif()
# Where voxeld looks for it: gpu/worker/worker_engine.h.
install(TARGETS voxeld-engine RUNTIME DESTINATION libexec/voxeld)
install(FILES ${packaging}/voxeld.service ${packaging}/voxeld.socket ${packaging}/voxeld-playlist.service
              ${packaging}/voxeld-engine.socket ${packaging}/voxeld-engine@.service DESTINATION lib/systemd/system)
install(FILES ${packaging}/user/voxeld.service ${packaging}/user/voxeld.socket DESTINATION lib/systemd/user)
install(FILES ${packaging}/voxeld.sysusers DESTINATION lib/sysusers.d RENAME voxeld.conf)
install(FILES ${packaging}/70-voxeld.rules DESTINATION lib/udev/rules.d)
install(FILES ${packaging}/voxeld.toml ${packaging}/playlist.toml DESTINATION ${doc}/examples)
install(DIRECTORY ${CMAKE_SOURCE_DIR}/display/profiles/ DESTINATION share/voxeld/profiles FILES_MATCHING PATTERN "*.toml")
install(FILES ${CMAKE_SOURCE_DIR}/LICENSE DESTINATION ${doc} RENAME copyright)
install(FILES ${CMAKE_SOURCE_DIR}/README.md ${CMAKE_SOURCE_DIR}/CHANGELOG.md ${CMAKE_SOURCE_DIR}/docs/operations.md
              ${CMAKE_SOURCE_DIR}/docs/configuration.md ${CMAKE_SOURCE_DIR}/docs/recordings.md DESTINATION ${doc})

# Manual pages and completions, which the programs write: into share/, as they are installed.
find_program(VOXELD_GZIP gzip REQUIRED)
set(written ${CMAKE_BINARY_DIR}/share)
add_custom_command(
  OUTPUT ${CMAKE_BINARY_DIR}/share.stamp
  COMMAND ${CMAKE_COMMAND} -DVOXELD=$<TARGET_FILE:voxeld> -DVOXELCTL=$<TARGET_FILE:voxelctl> -DGZIP=${VOXELD_GZIP} -DOUT=${written}
          -P ${CMAKE_SOURCE_DIR}/cmake/MakeManual.cmake
  COMMAND ${CMAKE_COMMAND} -E touch ${CMAKE_BINARY_DIR}/share.stamp
  DEPENDS voxeld voxelctl ${CMAKE_SOURCE_DIR}/cmake/MakeManual.cmake
  COMMENT "Writing manual pages and completions"
  VERBATIM)
add_custom_target(voxeld_manual ALL DEPENDS ${CMAKE_BINARY_DIR}/share.stamp)
install(DIRECTORY ${written}/ DESTINATION share)

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME voxeld)
set(CPACK_PACKAGE_VERSION ${PROJECT_VERSION})
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "driver service for volumetric displays")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_INSTALL_DEFAULT_DIRECTORY_PERMISSIONS OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE
                                                WORLD_READ WORLD_EXECUTE)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_MAINTAINER "${VOXELD_MAINTAINER}")
set(CPACK_DEBIAN_PACKAGE_SECTION graphics)
set(CPACK_DEBIAN_PACKAGE_PRIORITY optional)
set(CPACK_DEBIAN_PACKAGE_DESCRIPTION
    "Networked clients stream 3D primitives in over gRPC; voxeld assembles the voxel\nscene, slices it, and pushes whole volumes of light to the display. With the\nclient voxelctl, udev rules and a systemd service.")
set(CPACK_DEBIAN_PACKAGE_DEPENDS "passwd, procps")  # for postinst and reload
set(CPACK_DEBIAN_PACKAGE_RECOMMENDS "fonts-dejavu-core, hershey-fonts-data")  # text
set(CPACK_DEBIAN_PACKAGE_SUGGESTS "ffmpeg")  # voxelctl render to MP4
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)
set(CPACK_DEBIAN_PACKAGE_CONTROL_EXTRA ${packaging}/deb/postinst ${packaging}/deb/prerm ${packaging}/deb/postrm)
include(CPack)
