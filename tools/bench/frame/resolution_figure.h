// A figure that shows how the time of an implicit surface grows with the resolution.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace voxeld::bench::frame {

// Returns an SVG of the rows (frame_bench.h) of the scene "implicit": time on the device against
// the side of the grid, both axes logarithmic, one curve for each machine, and beside the slowest
// curve the slope of a time that grows with the square. Empty if there are no such rows. It reads
// scene, grid, engine, device, threads and device_ms.median of each row.
std::string ResolutionSvg(const nlohmann::json& rows);

}  // namespace voxeld::bench::frame
