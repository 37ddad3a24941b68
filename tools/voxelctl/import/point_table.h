// Converts points that are rows of numbers, whatever their file: identifies the columns, and adds
// one row after another to a model.
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

// The meaning of a column. Its value is the index in a row.
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

// Recognises the names that files use, case-insensitively: "x", "easting", "nx", "normal_x", "r",
// "red", "diffuse_red", "i", "intensity", … Returns nothing for another column.
std::optional<PointColumn> PointColumnOf(absl::string_view name);

// Returns: the channel value of full brightness (1, 255 or 65,535), given the greatest in the file.
double FullScaleOf(double greatest);
bool IsColor(PointColumn column);

// Converts rows to points. Without colours, intensities become greys, stretched from the least to
// the greatest.
class PointTable {
 public:
  // Makes a table. `full_scale` is the channel value of full brightness. Errors: InvalidArgument
  // without x, y and z.
  static absl::StatusOr<PointTable> Make(const SourceFile& file,
                                         const std::array<bool, kPointColumns>& has,
                                         double full_scale);

  void Reserve(uint64_t count);
  // Names the further numbers that Add receives for each point. Requires: called before the first
  // Add.
  void SetAttributes(std::vector<std::string> names);
  // Adds a point. One with a coordinate that is not a number is left out and counted; one whose
  // colour is not a number is white, and counted too. `what` names the row, as in "point 3" or
  // "line 17"; `attributes` has one value for each name. Errors: InvalidArgument if a coordinate is
  // infinite, or there are more than kMaxModelVertices.
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
  uint64_t nowhere_ = 0, uncolored_ = 0;  // points without a position or colour
};

}  // namespace voxeld::voxelctl
