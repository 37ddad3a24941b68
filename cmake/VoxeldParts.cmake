# The parts that a build may leave out. Packages have all of them. A library of a part that is OFF is not searched for, and
# voxelctl answers for the part with the option that adds it (tools/voxelctl/not_built.h).
option(VOXELD_IMPORTERS "File formats beside STL, PLY, VOX, text clouds and GeoJSON (assimp, gdcm, nifti, libxml2, GLU, lzf)" ON)
option(VOXELD_RECORDING "Recordings and playlists: voxelctl record, replay, playlist (zstd)" ON)
option(VOXELD_LIGHTS "LED protocols as inputs: voxelctl input, pipe" ON)
option(VOXELD_MARKERS "Markers from Foxglove's protocol: voxelctl markers" ON)
option(VOXELD_ROS "voxeld-ros, markers from ROS 1; skipped where roscpp is missing, and without VOXELD_MARKERS" ON)
option(VOXELD_BENCH "Build the benchmarks" ON)
option(VOXELD_PAGE "The page that voxeld serves; skipped where node or its modules are missing" ON)

# Tests that go through several parts run where all of these are built.
set(VOXELD_ALL_PARTS OFF)
if(VOXELD_IMPORTERS AND VOXELD_RECORDING AND VOXELD_LIGHTS AND VOXELD_MARKERS)
  set(VOXELD_ALL_PARTS ON)
endif()

# voxeld_part_needs(OPTION FOUND NAME PACKAGE): ends the configuration if the variable FOUND is false, and says what to install and
# which option leaves the part out.
function(voxeld_part_needs option found name package)
  if(NOT ${found})
    message(FATAL_ERROR "${name} was not found, which ${option}=ON needs. Install the Debian package ${package}, or leave the part out "
                        "with -D${option}=OFF.")
  endif()
endfunction()
