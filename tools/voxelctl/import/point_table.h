// Points that come as rows of numbers, whatever file they are from: which column is what, and a row
// after another into a model.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "tools/voxelctl/import/model.h"
#include "tools/voxelctl/import/source_file.h"

namespace voxeld::voxelctl {

// What a column may be. Its value is its place in a row.
enum class PointColumn : uint8_t {
  kX,
  kY,
  kZ,
  kNormalX,
  kNormalY,
  kNormalZ,
  kRed,
  kGreen,
  kBlue,
  kIntensity
};
inline constexpr size_t kPointColumns = 10;
using PointRow = std::array<double, kPointColumns>;

// By the names that files use, in any case: "x", "easting", "nx", "normal_x", "r", "red", "diffuse_red",
// "i", "intensity", … Nothing: another column.
std::optional<PointColumn> PointColumnOf(absl::string_view name);

// Returns: the channel value of full brightness (1, 255 or 65,535), given the greatest in the file.
double FullScaleOf(double greatest);
bool IsColor(PointColumn column);

// Rows become points: intensities become greys where there are no colours, stretched from the least to
// the greatest.
class PointTable {
 public:
  // Without x, y and z InvalidArgument. `full_scale`: the value of a colour's channel that is as bright as
  // can be.
  static absl::StatusOr<PointTable> Make(const SourceFile& file,
                                         const std::array<bool, kPointColumns>& has,
                                         double full_scale);

  void Reserve(uint64_t count);
  // Names the further numbers that Add gets of each point. Call it before the first Add.
  void SetAttributes(std::vector<std::string> names);
  // A point with a coordinate that is not a number is left out and counted; one whose colour is none is white, and counted too.
  // InvalidArgument: a coordinate is infinite, or there are more than kMaxModelVertices; `what` names the row, as in "point 3" or
  // "line 17". `attributes`: one of each name.
  absl::Status Add(const SourceFile& file, const PointRow& row, absl::string_view what,
                   std::span<const double> attributes = {});
  size_t size() const { return part_.positions.size(); }

  Model Finish(const SourceFile& file, std::string format) &&;

 private:
  bool Has(PointColumn column) const { return has_[static_cast<size_t>(column)]; }

  std::array<bool, kPointColumns> has_ = {};
  double full_scale_ = 1;
  Part part_;
  std::vector<float> intensities_;
  uint64_t nowhere_ = 0, uncolored_ = 0;  // points without a place or colour
};

}  // namespace voxeld::voxelctl
