// What a generator takes for a batch of some size, as it was measured on this machine once.
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
  double seconds_a_segment = 0;  // of each further one

  // Between the points straight in the logarithms; beyond them as the last two go on.
  double SecondsFor(uint64_t voxels, uint64_t segments) const;
};

// Times whole calls, the result in the generator's own host memory; takes about a tenth of a second.
absl::StatusOr<CostCurve> MeasureCost(Generator& generator, Sampling sampling);

// One line a generator, of its name and the figures, below one that names `machine`.
std::string ToText(std::string_view machine,
                   const std::vector<std::pair<std::string, CostCurve>>& curves);
// NotFound: the text is of another machine or other generators; DataLoss: it is none.
absl::StatusOr<std::vector<CostCurve>> FromText(std::string_view text, std::string_view machine,
                                                const std::vector<std::string>& names);

}  // namespace voxeld::gpu::generate
