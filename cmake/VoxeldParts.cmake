# Optional parts of a build. They are on by default, or off with VOXELD_MINIMAL. An option that was given keeps its value in later runs
# of CMake, so parts can be added one after the other. Packages include all of them except voxeld-ros, which would make ROS a dependency. The libraries of a
# disabled part are not required; voxelctl then prints the commands that add the part (tools/voxelctl/text/not_built.h).
option(VOXELD_MINIMAL "Turn off by default all optional parts except VOXELD_PAGE (for new build folders)" OFF)
set(by_default ON)
if(VOXELD_MINIMAL)
  set(by_default OFF)
endif()
option(VOXELD_IMPORTERS "More file formats than STL, PLY, VOX, GeoJSON, TopoJSON and points as text (assimp, tinygltf, tinyobjloader, GDAL, gdcm, gemmi, nifti, librsvg, libtiff, libxml2, lzf)" ${by_default})
option(VOXELD_RECORDING "Recordings and playlists: voxelctl record, replay, playlist (zstd)" ${by_default})
option(VOXELD_LIGHTS "LED protocols as input: voxelctl input and pipe" ${by_default})
option(VOXELD_MARKERS "Foxglove marker client: voxelctl markers" ${by_default})
option(VOXELD_ROS "voxeld-ros (ROS 1 markers); requires VOXELD_MARKERS; skipped if roscpp is missing" ${by_default})
option(VOXELD_BENCH "Build the benchmarks" ${by_default})
option(VOXELD_PYTHON_CLIENT "Python client: the wheel (target python_client)" ${by_default})
option(VOXELD_PAGE "Web viewer served by voxeld; skipped if Node.js or its npm packages are missing" ON)

# Tests that use several parts run if all of these are built.
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
