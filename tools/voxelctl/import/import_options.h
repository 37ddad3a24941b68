// The options for reading files.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <optional>

#include "absl/strings/string_view.h"
#include "tools/voxelctl/import/source_file.h"

namespace voxeld::voxelctl {

// Small balls with bonds between them, or balls as large as the atoms.
enum class MoleculeStyle : uint8_t { kBalls, kSpace };

enum class SampleType : uint8_t { kI8, kU8, kI16, kU16, kI32, kU32, kI64, kU64, kF16, kF32, kF64 };

// The names used in options, in the enumeration's order.
inline constexpr absl::string_view kSampleTypeNames[] = {"i8",  "u8",  "i16", "u16", "i32", "u32",
                                                         "i64", "u64", "f16", "f32", "f64"};
static_assert(std::size(kSampleTypeNames) == static_cast<size_t>(SampleType::kF64) + 1);

// The layout of a file of raw samples (.raw).
struct RawLayout {
  std::array<uint64_t, 3> size = {};
  SampleType type = SampleType::kU8;
  bool big_endian = false;
};

struct ImportOptions {
  bool globe = false;  // longitude and latitude of maps go on a sphere; other files ignore it
  std::optional<RawLayout> raw;
  MoleculeStyle style = MoleculeStyle::kBalls;
  // Keeps the numbers of points, atoms and vertices that are not positions, normals or colours.
  bool attributes = false;
  std::array<uint32_t, 2> pixels = {512, 512};  // maximum size of a drawing, width and height
  OtherFiles other_files = OtherFiles::kBelow;
};

}  // namespace voxeld::voxelctl
