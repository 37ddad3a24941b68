// Reads the body of a PLY file value by value, and its vertices, which clouds and meshes have in
// common.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "tools/voxelctl/import/model.h"
#include "tools/voxelctl/import/ply_header.h"
#include "tools/voxelctl/import/point_table.h"
#include "tools/voxelctl/import/source_file.h"

namespace voxeld::voxelctl {

// Returns the values of a file's body one by one, whatever their encoding. It is a view of the
// file.
class PlyValues {
 public:
  PlyValues(const SourceFile& file, const PlyHeader& header)
      : rest_(absl::string_view(file.bytes).substr(header.body)), format_(header.format) {}

  // Returns: false at the end of the data, or without a number.
  bool Next(PlyType type, double* value);

 private:
  bool NextWord(double* value);
  bool NextBinary(PlyType type, double* value);
  template <typename T>
  double Take();

  absl::string_view rest_;
  PlyHeader::Format format_;
};

// The colors of an element's entries, in properties of any type. 8-bit values are at full
// brightness at their maximum. The scale of others depends on the greatest value in the whole file:
// exporters write 0 to 255 in any type.
class PlyColors {
 public:
  // `columns`: of each property of the element. Requires: all channels or none.
  PlyColors(const PlyElement& element, const PointColumns& columns);
  // Whether there are all three channels.
  bool found() const { return found_; }
  void Reserve(size_t entries);
  // Takes the color of the next entry.
  void Add(const PointRow& row);
  // Returns: the colors of all entries. `unknown`: those whose color is not finite, which have kUnknownColor.
  std::vector<Rgb> Finish(std::vector<uint32_t>* unknown) &&;

 private:
  // Which value means full brightness.
  enum class Scale : uint8_t { kOfType, kWholeNumbers, kFractions };

  void AddColor(const double (&channels)[3]);

  bool found_ = false;
  Scale scales_[3] = {};
  double full_scale_[3] = {1, 1, 1};
  double most_whole_ = 0, most_fraction_ = 0;  // over all entries
  bool is_known_ = true;                       // whether all scales are determined by the types
  std::vector<Rgb> colors_;
  std::vector<float> numbers_;     // until the scales are known, instead of `colors_`
  std::vector<uint32_t> unknown_;  // indices of `colors_`
};

struct PlyVertices {
  std::vector<Point3> positions;      // not all finite
  std::vector<Point3> normals;        // of unit length, or zero; or none
  std::vector<Rgb> colors;            // or none
  std::vector<uint32_t> unknown;      // which colors are not finite in the file, in ascending order
  std::vector<float> intensities;     // or none
  std::vector<Attribute> attributes;  // the other scalar properties, if requested
  uint64_t others = 0;                // properties that are not there
};

// Returns: what each property of an element is. Lists are nothing.
PointColumns PlyColumns(const PlyElement& element);

// Reads the entries of "vertex": the columns of point_table.h, of any type; intensities only if colours `may_be_grey`.
// Returns: InvalidArgument with the number of the vertex that is cut off or no number.
absl::StatusOr<PlyVertices> ReadPlyVertices(const SourceFile& file, const PlyElement& vertex,
                                            bool attributes, bool may_be_grey, PlyValues* values);

// Skips the entries of an element. Returns: InvalidArgument with the truncated entry.
absl::Status SkipPlyElement(const SourceFile& file, const PlyElement& element, PlyValues* values);

}  // namespace voxeld::voxelctl
