# find_package(voxeld_client): the target voxeld::client.
include(CMakeFindDependencyMacro)
find_dependency(absl)
include(${CMAKE_CURRENT_LIST_DIR}/voxeld_client-targets.cmake)
