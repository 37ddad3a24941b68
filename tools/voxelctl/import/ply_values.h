// The body of a PLY file, value by value, and its vertices, which clouds and meshes share.
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

// Hands out the values of a file's body one by one, whichever way they are written. Views the file.
class PlyValues {
 public:
  PlyValues(const SourceFile& file, const PlyHeader& header)
      : rest_(absl::string_view(file.bytes).substr(header.body)), format_(header.format) {}

  // Returns: false at the end of the data, or where there is no number.
  bool Next(PlyType type, double* value);

 private:
  bool NextWord(double* value);
  bool NextBinary(PlyType type, double* value);
  template <typename T>
  double Take();

  absl::string_view rest_;
  PlyHeader::Format format_;
};

// The colors of an element's entries, in properties of any type. Numbers of 8 bits are as bright as can be at their greatest value.
// The scale of others is that of the greatest number in the whole file: exporters write 0 to 255 in whatever type they have.
class PlyColors {
 public:
  explicit PlyColors(const PlyElement& element);
  // Whether there are all three channels.
  bool found() const { return at_[0] >= 0 && at_[1] >= 0 && at_[2] >= 0; }
  // 0 to 2; −1: the property is no channel.
  int ChannelOf(size_t property) const;
  void Reserve(size_t entries);
  // Takes the color of the next entry.
  void Add(const double (&channels)[3]);
  // Returns: the colors of all entries.
  std::vector<Rgb> Finish() &&;

 private:
  // Which number is as bright as can be.
  enum class Scale : uint8_t { kOfType, kWholeNumbers, kFractions };

  Rgb ColorOf(const double (&channels)[3]) const;

  int at_[3] = {-1, -1, -1};  // of each channel the property's index
  Scale scales_[3] = {};
  double full_scale_[3] = {1, 1, 1};
  double most_whole_ = 0, most_fraction_ = 0;  // of all entries
  bool is_known_ = true;                       // whether all scales are those of their types
  std::vector<Rgb> colors_;
  std::vector<float> numbers_;  // until the scales are known, instead of `colors_`
};

struct PlyVertices {
  std::vector<Point3> positions;      // not all finite
  std::vector<Point3> normals;        // of unit length, or zero; or none
  std::vector<Rgb> colors;            // or none
  std::vector<Attribute> attributes;  // the other properties that are no lists, if they are wanted
  uint64_t others = 0;                // properties that are not there
};

// Reads the entries of "vertex": x, y, z; nx, ny, nz; red, green, blue (also r, g, b and diffuse_…) of any type.
// Returns: InvalidArgument with the number of the vertex that is cut off or no number.
absl::StatusOr<PlyVertices> ReadPlyVertices(const SourceFile& file, const PlyElement& vertex,
                                            bool attributes, PlyValues* values);

// Passes over the entries of an element. Returns: InvalidArgument with the entry that is cut off.
absl::Status SkipPlyElement(const SourceFile& file, const PlyElement& element, PlyValues* values);

}  // namespace voxeld::voxelctl
