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
  explicit PlyColors(const PlyElement& element);
  // Returns whether all three channels exist.
  bool found() const { return at_[0] >= 0 && at_[1] >= 0 && at_[2] >= 0; }
  // Returns 0 to 2; −1 if the property is not a channel.
  int ChannelOf(size_t property) const;
  void Reserve(size_t entries);
  // Adds the color of the next entry.
  void Add(const double (&channels)[3]);
  // Returns: the colors of all entries.
  std::vector<Rgb> Finish() &&;

 private:
  // Which value means full brightness.
  enum class Scale : uint8_t { kOfType, kWholeNumbers, kFractions };

  Rgb ColorOf(const double (&channels)[3]) const;

  int at_[3] = {-1, -1, -1};  // per channel, the property's index
  Scale scales_[3] = {};
  double full_scale_[3] = {1, 1, 1};
  double most_whole_ = 0, most_fraction_ = 0;  // over all entries
  bool is_known_ = true;                       // whether all scales are determined by the types
  std::vector<Rgb> colors_;
  std::vector<float> numbers_;  // until the scales are known, instead of `colors_`
};

struct PlyVertices {
  std::vector<Point3> positions;      // not necessarily finite
  std::vector<Point3> normals;        // unit vectors, or zero; may be empty
  std::vector<Rgb> colors;            // may be empty
  std::vector<Attribute> attributes;  // the other properties that are not lists, if requested
  uint64_t others = 0;                // properties that are not read
};

// Reads the entries of "vertex": x, y, z; nx, ny, nz; red, green, blue (also r, g, b and diffuse_…)
// of any type. Returns: InvalidArgument with the number of a vertex that is truncated or not a
// number.
absl::StatusOr<PlyVertices> ReadPlyVertices(const SourceFile& file, const PlyElement& vertex,
                                            bool attributes, PlyValues* values);

// Skips the entries of an element. Returns: InvalidArgument with the truncated entry.
absl::Status SkipPlyElement(const SourceFile& file, const PlyElement& element, PlyValues* values);

}  // namespace voxeld::voxelctl
