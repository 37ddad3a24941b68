// The header of a PLY file, checked against the file's size. (Greg Turk, "The PLY Polygon File
// Format", 1994.)
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "tools/voxelctl/import/source_file.h"

namespace voxeld::voxelctl {

enum class PlyType : uint8_t { kI8, kU8, kI16, kU16, kI32, kU32, kF32, kF64 };

// Returns the number of bytes of one value in a binary file.
size_t PlySize(PlyType type);

struct PlyProperty {
  std::string name;
  PlyType type = PlyType::kF32;
  bool is_list = false;
  PlyType count_type = PlyType::kU8;  // for a list
};

struct PlyElement {
  std::string name;
  uint64_t count = 0;
  std::vector<PlyProperty> properties;
};

struct PlyHeader {
  enum class Format : uint8_t { kAscii, kBinaryLittleEndian, kBinaryBigEndian };
  Format format = Format::kAscii;
  std::vector<PlyElement> elements;
  size_t body = 0;        // offset of the data
  uint64_t pictures = 0;  // textures that comments name ("comment TextureFile NAME", MeshLab's)

  // Returns null if the element does not exist or has no entries.
  const PlyElement* Find(absl::string_view name) const;

  // Returns how many entries the elements other than vertices, faces and strips have.
  uint64_t OtherEntries() const;
};

// Parses the header. Errors: InvalidArgument if it is not a PLY header, has no vertices with x, y
// and z, or declares more data than the file can hold (not checked with kUnchecked).
enum class PlyCounts : uint8_t { kChecked, kUnchecked };
absl::StatusOr<PlyHeader> ParsePlyHeader(const SourceFile& file,
                                         PlyCounts counts = PlyCounts::kChecked);

}  // namespace voxeld::voxelctl
