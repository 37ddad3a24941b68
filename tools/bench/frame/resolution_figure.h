// How the time of an implicit surface grows with the resolution, as a figure.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace voxeld::bench::frame {

// An SVG of the rows (frame_bench.h) of the scene "implicit": time on the device against the grid's
// side, both by their logarithms, a curve for each machine, and beside the slowest the slope of a
// time that grows with the square. Empty: there is no such row. Of rows it takes scene, grid, engine,
// device, threads and device_ms.median.
std::string ResolutionSvg(const nlohmann::json& rows);

}  // namespace voxeld::bench::frame
