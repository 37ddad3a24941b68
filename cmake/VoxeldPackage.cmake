# Defines what `cmake --install` installs, and the Debian packages (tools/package, or cpack --preset
# release), one per component: `service` is the package voxeld, `cuda` is voxeld-cuda, `import` is
# voxeld-import, and `client` (client/cpp/CMakeLists.txt) is libvoxeld-dev. The paths in packaging/
# assume the prefix /usr.
include(GNUInstallDirs)
set(CMAKE_INSTALL_DEFAULT_COMPONENT_NAME service)
set(VOXELD_MAINTAINER "voxeld maintainers <maintainers@voxeld.invalid>" CACHE STRING "Maintainer of the package")

set(doc ${CMAKE_INSTALL_DATADIR}/doc/voxeld)
set(packaging ${CMAKE_SOURCE_DIR}/packaging)
# voxeld_install_programs(DESTINATION COMPONENT [EXCLUDE_FROM_ALL] TARGET …): installs the programs and
# removes the build's RPATH (VoxeldTargets.cmake).
function(voxeld_install_programs destination component)
  cmake_parse_arguments(ARG "EXCLUDE_FROM_ALL" "" "" ${ARGN})
  set(all "")
  if(ARG_EXCLUDE_FROM_ALL)
    set(all EXCLUDE_FROM_ALL)
  endif()
  foreach(target ${ARG_UNPARSED_ARGUMENTS})
    install(TARGETS ${target} RUNTIME DESTINATION ${destination} COMPONENT ${component} ${all})
    install(CODE "file(RPATH_REMOVE FILE \"\$ENV{DESTDIR}\${CMAKE_INSTALL_PREFIX}/${destination}/${target}\")" COMPONENT ${component} ${all})
  endforeach()
endfunction()
voxeld_install_programs(${CMAKE_INSTALL_BINDIR} service voxeld voxelctl)
# Not part of the package, which would then depend on ROS: cmake --install BUILD --component ros
if(TARGET voxeld-ros)
  voxeld_install_programs(${CMAKE_INSTALL_BINDIR} ros EXCLUDE_FROM_ALL voxeld-ros)
endif()
# The folder where voxeld looks for it: gpu/worker/worker_engine.h.
voxeld_install_programs(libexec/voxeld service voxeld-engine)
if(TARGET voxeld-engine-cuda)
  voxeld_install_programs(libexec/voxeld cuda voxeld-engine-cuda)
  install(FILES ${packaging}/cuda/voxeld-engine.conf DESTINATION lib/systemd/system/voxeld-engine@.service.d RENAME 50-voxeld-cuda.conf
          COMPONENT cuda)
  install(FILES ${CMAKE_SOURCE_DIR}/LICENSE DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/voxeld-cuda RENAME copyright COMPONENT cuda)
endif()
# The folder where voxelctl looks for it: tools/voxelctl/import/import_program.cc.
if(TARGET voxeld-import)
  voxeld_install_programs(libexec/voxeld import voxeld-import)
  install(FILES ${CMAKE_SOURCE_DIR}/LICENSE DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/voxeld-import RENAME copyright COMPONENT import)
endif()
install(FILES ${packaging}/voxeld.service ${packaging}/voxeld.socket ${packaging}/voxeld-playlist.service
              ${packaging}/voxeld-engine.socket ${packaging}/voxeld-engine@.service DESTINATION lib/systemd/system)
install(FILES ${packaging}/user/voxeld.service ${packaging}/user/voxeld.socket DESTINATION lib/systemd/user)
install(FILES ${packaging}/voxeld.sysusers DESTINATION lib/sysusers.d RENAME voxeld.conf)
install(FILES ${packaging}/70-voxeld.rules DESTINATION lib/udev/rules.d)
install(FILES ${packaging}/voxeld.toml ${packaging}/playlist.toml DESTINATION ${doc}/examples)
install(DIRECTORY ${CMAKE_SOURCE_DIR}/display/profiles/ DESTINATION share/voxeld/profiles FILES_MATCHING PATTERN "*.toml")
install(FILES ${CMAKE_SOURCE_DIR}/LICENSE DESTINATION ${doc} RENAME copyright)
install(FILES ${CMAKE_SOURCE_DIR}/README.md ${CMAKE_SOURCE_DIR}/CHANGELOG.md ${CMAKE_SOURCE_DIR}/docs/operations.md
              ${CMAKE_SOURCE_DIR}/docs/configuration.md ${CMAKE_SOURCE_DIR}/docs/recordings.md ${CMAKE_SOURCE_DIR}/SECURITY.md
        DESTINATION ${doc})

# The programs generate manual pages and completions, which are installed into share/.
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

# The SBOM, derived from the programs and from Ninja's log, and the licence notices.
set(sbom ${CMAKE_BINARY_DIR}/sbom)
find_program(VOXELD_DPKG_QUERY dpkg-query)
if(VOXELD_DPKG_QUERY AND CMAKE_GENERATOR STREQUAL "Ninja")
  set(arguments "")
  if(TARGET voxeld_page)
    get_target_property(page voxeld_page PAGE_FOLDER)
    list(APPEND arguments --modules ${VOXELD_NODE_MODULES} --bundled ${page}/modules.json)
  endif()
  set(cuda_program "")
  if(TARGET voxeld-engine-cuda)
    list(APPEND arguments --cuda ${CUDAToolkit_VERSION})
    set(cuda_program --program $<TARGET_FILE:voxeld-engine-cuda>)
    set(cuda_target voxeld-engine-cuda)
  endif()
  set(import_program "")
  if(TARGET voxeld-import)
    set(import_program --program $<TARGET_FILE:voxeld-import>)
    set(import_target voxeld-import)
  endif()
  foreach(tool ${CMAKE_CXX_COMPILER} ${VOXELD_MOLD} ${CMAKE_COMMAND} ${CMAKE_MAKE_PROGRAM} ${VOXELD_NODE} ${VOXELD_GRPC_PYTHON_PLUGIN})
    list(APPEND arguments --tool ${tool})
  endforeach()
  file(GLOB scripts CONFIGURE_DEPENDS ${CMAKE_SOURCE_DIR}/tools/sbom/*.py)
  add_custom_command(
    OUTPUT ${sbom}/voxeld.spdx.json ${sbom}/NOTICES
    COMMAND ${VOXELD_PYTHON} -B ${CMAKE_SOURCE_DIR}/tools/sbom/sbom.py --build ${CMAKE_BINARY_DIR} --version ${PROJECT_VERSION}
            --epoch ${VOXELD_EPOCH} --program $<TARGET_FILE:voxeld> --program $<TARGET_FILE:voxelctl> --program $<TARGET_FILE:voxeld-engine> ${cuda_program} ${import_program}
            --notice ${packaging}/notices/colormaps.txt --out ${sbom}/voxeld.spdx.json --out-notices ${sbom}/NOTICES ${arguments}
    DEPENDS voxeld voxelctl voxeld-engine ${cuda_target} ${import_target} ${scripts} ${packaging}/notices/colormaps.txt
    COMMENT "Listing what voxeld is made of"
    VERBATIM)
  add_custom_target(sbom ALL DEPENDS ${sbom}/voxeld.spdx.json ${sbom}/NOTICES)
  install(FILES ${sbom}/voxeld.spdx.json ${sbom}/NOTICES DESTINATION ${doc})
  file(MAKE_DIRECTORY ${sbom})
else()
  message(STATUS "voxeld is built without a list of what it is made of: that takes dpkg and Ninja")
endif()

# Everything that tools/package needs: programs, manual, SBOM and client libraries; no tests. Also
# voxel-bench, to measure this build; it is not published, because it compares with a loop that is
# compiled for the processor of the build machine.
add_custom_target(packaged DEPENDS voxeld voxelctl voxeld-engine voxeld-emulator voxeld_client_shared voxeld_manual python_client)
foreach(part voxeld-engine-cuda voxeld-import voxel-bench sbom)
  if(TARGET ${part})
    add_dependencies(packaged ${part})
  endif()
endforeach()

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME voxeld)
set(CPACK_PACKAGE_VERSION ${PROJECT_VERSION})
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_INSTALL_DEFAULT_DIRECTORY_PERMISSIONS OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE
                                                WORLD_READ WORLD_EXECUTE)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_COMPONENTS_GROUPING IGNORE)
set(CPACK_COMPONENTS_ALL service client)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_MAINTAINER "${VOXELD_MAINTAINER}")
set(CPACK_DEBIAN_PACKAGE_PRIORITY optional)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)

set(CPACK_DEBIAN_SERVICE_PACKAGE_NAME voxeld)
set(CPACK_DEBIAN_SERVICE_PACKAGE_SECTION graphics)
set(CPACK_DEBIAN_SERVICE_DESCRIPTION
    "driver service for volumetric displays\nNetworked clients stream 3D primitives in over gRPC; voxeld assembles the voxel\nscene, slices it, and pushes whole volumes of light to the display. With the\nclient voxelctl, udev rules and a systemd service.")
set(CPACK_DEBIAN_SERVICE_PACKAGE_DEPENDS "passwd, procps")  # for postinst and reload
set(CPACK_DEBIAN_SERVICE_PACKAGE_RECOMMENDS "voxeld-import, fonts-dejavu-core, hershey-fonts-data")  # the fonts are for text
set(CPACK_DEBIAN_SERVICE_PACKAGE_SUGGESTS "voxeld-cuda, ffmpeg")  # voxelctl render to MP4
set(CPACK_DEBIAN_SERVICE_PACKAGE_CONTROL_EXTRA ${packaging}/deb/postinst ${packaging}/deb/prerm ${packaging}/deb/postrm)

if(TARGET voxeld-import)
  list(APPEND CPACK_COMPONENTS_ALL import)
  set(CPACK_DEBIAN_IMPORT_PACKAGE_NAME voxeld-import)
  set(CPACK_DEBIAN_IMPORT_PACKAGE_SECTION graphics)
  set(CPACK_DEBIAN_IMPORT_DESCRIPTION
      "more file formats for voxelctl\nMeshes with materials, volumes, molecules, maps and drawings, besides the formats that\nvoxelctl reads itself (STL, PLY, VOX, GeoJSON and point clouds as text).")
  # The two programs share one version of their protocol.
  set(CPACK_DEBIAN_IMPORT_PACKAGE_DEPENDS "voxeld (= ${PROJECT_VERSION})")
endif()

if(TARGET voxeld-engine-cuda)
  list(APPEND CPACK_COMPONENTS_ALL cuda)
  set(CPACK_DEBIAN_CUDA_PACKAGE_NAME voxeld-cuda)
  set(CPACK_DEBIAN_CUDA_PACKAGE_SECTION graphics)
  set(CPACK_DEBIAN_CUDA_DESCRIPTION
      "CUDA engine of voxeld, for NVIDIA GPUs\nThe daemon starts it where a GPU is found, in place of the engine on the CPU, and\ngoes back to that one when this package is removed. It needs the GPU's driver.")
  # The two programs share one version of their protocol.
  set(CPACK_DEBIAN_CUDA_PACKAGE_DEPENDS "voxeld (= ${PROJECT_VERSION})")
  # Used if present: the driver, and several GPUs for one display.
  set(CPACK_DEBIAN_CUDA_PACKAGE_SUGGESTS "libcuda1, libnccl2")
  set(CPACK_DEBIAN_CUDA_PACKAGE_CONTROL_EXTRA ${packaging}/cuda/postinst ${packaging}/cuda/postrm)
endif()

set(CPACK_DEBIAN_CLIENT_PACKAGE_NAME libvoxeld-dev)
set(CPACK_DEBIAN_CLIENT_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_CLIENT_DESCRIPTION
    "development files of voxeld, the driver service for volumetric displays\nThe C++ client library with its headers and CMake files, and the protocol as\n.proto files, for clients in other languages.")
set(CPACK_DEBIAN_CLIENT_PACKAGE_DEPENDS "libabsl-dev")  # its headers include Abseil's
set(CPACK_DEBIAN_CLIENT_PACKAGE_SUGGESTS "voxeld")
# Archives always carry the commit's time (cmake/VoxeldHardening.cmake).
file(CONFIGURE OUTPUT ${CMAKE_BINARY_DIR}/PackProject.cmake @ONLY CONTENT [[
if(NOT DEFINED ENV{SOURCE_DATE_EPOCH})
  set(ENV{SOURCE_DATE_EPOCH} @VOXELD_EPOCH@)
endif()
]])
set(CPACK_PROJECT_CONFIG_FILE ${CMAKE_BINARY_DIR}/PackProject.cmake)
include(CPack)
