// Converts points that are rows of numbers, whatever their file: identifies the columns, and adds
// one row after another to a model.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
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
  kIntensity,
  kPackedColor  // all channels in one number; a row has them apart
};
inline constexpr size_t kPointColumns = 10;  // of a row
using PointRow = std::array<double, kPointColumns>;
// The role of each column of a file; nullopt: another number.
using PointColumns = std::vector<std::optional<PointColumn>>;

// Finds columns by the names that files use, in any case: "x", "easting", "nx", "normal_x", "r", "red", "diffuse_red", "i", "intensity", …
// Names of one kind go together: of "r", "red", "green" and "blue" the last three are the colour. Of two columns with one name the first
// is taken.
PointColumns PointColumnsByName(std::span<const std::string> names);

// Which columns are shown, and which are numbers for --color-by. All formats of points decide it here.
struct PointLayout {
  // The columns of a colour or normal that is not complete are other numbers, and so is the intensity of points that have colours, or where
  // it `may_be_grey` is false. A packed colour goes before channels of their own.
  static PointLayout Of(PointColumns columns, bool may_be_grey = true);

  bool Has(PointColumn column) const { return has[static_cast<size_t>(column)]; }

  PointColumns shown;                        // of each column of the file
  std::array<bool, kPointColumns> has = {};  // whether rows have it
  std::vector<size_t> others;                // columns that are not shown
  std::vector<size_t> attributes;            // `others` and the intensity, in the file's order
};

bool IsColor(PointColumn column);

// Finds the value of a colour's channel that is as bright as can be, given all of the file.
class ChannelRange {
 public:
  void Add(double channel);
  // Returns: 1, 255 or 65,535.
  double FullScale() const { return greatest_ <= 1 ? 1 : greatest_ <= 255 ? 255 : 65535; }

 private:
  double greatest_ = 0;
};

// Returns: the colour whose channels are these parts of full brightness, or nothing if one is not finite.
std::optional<Rgb> ColorOfChannels(double red, double green, double blue);
// The substitute that is shown, and the kind under which it is counted.
inline constexpr Rgb kUnknownColor = {255, 255, 255};
inline constexpr std::string_view kUnknownColors =
    "colours and intensities that are not a number (shown white)";

// Returns: greys from the least intensity to the greatest, or white where all are alike. Adds those that are not finite to `unknown`.
std::vector<Rgb> GreysOf(std::span<const float> intensities, uint64_t* unknown);

// Returns: the number that a word in a text is, with a sign or without; nothing if it is not one.
std::optional<double> NumberOfWord(absl::string_view word);

// Converts rows to points. Intensities become greys where there are no colours, stretched from the least to
// the greatest.
class PointTable {
 public:
  // Without x, y and z InvalidArgument. `full_scale`: the value of a colour's channel that is as bright as
  // can be.
  static absl::StatusOr<PointTable> Make(const SourceFile& file, const PointLayout& layout,
                                         double full_scale);

  void Reserve(uint64_t count);
  // Names the further numbers that Add receives for each point. Requires: called before the first
  // Add.
  void SetAttributes(std::vector<std::string> names);
  // A point with a coordinate that is not a number is left out and counted; one whose colour is not finite is white, and counted too.
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
  uint64_t nowhere_ = 0, uncolored_ = 0;  // points without a position or colour
};

}  // namespace voxeld::voxelctl
