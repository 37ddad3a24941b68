// The time that a generator takes for a batch of some size, as measured once on this machine.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "gpu/generate/generator.h"

namespace voxeld::gpu::generate {

struct CostCurve {
  // Voxels of one segment, i32x3, and seconds; ascending, at least two.
  std::vector<std::pair<double, double>> points;
  double seconds_a_segment = 0;  // for each further segment

  // Interpolates linearly in the logarithms; beyond the points, extrapolates from the last two.
  double SecondsFor(uint64_t voxels, uint64_t segments) const;
};

// Times whole calls, with the result in the generator's own host memory. Takes about a tenth of a
// second.
absl::StatusOr<CostCurve> MeasureCost(Generator& generator, Sampling sampling);

// Returns one line for each generator, with its name and costs, below a line that names `machine`.
std::string ToText(std::string_view machine,
                   const std::vector<std::pair<std::string, CostCurve>>& curves);
// Errors: NotFound if the text is from another machine or other generators; DataLoss if it is
// malformed.
absl::StatusOr<std::vector<CostCurve>> FromText(std::string_view text, std::string_view machine,
                                                const std::vector<std::string>& names);

}  // namespace voxeld::gpu::generate
