// Describes a file format for users. docs/files.md has these as a table, which tools/import/main.cc writes.
#pragma once

#include <string>
#include <vector>

#include "absl/strings/string_view.h"

namespace voxeld::voxelctl {

struct Format {
  absl::string_view what;        // "meshes"
  absl::string_view name;        // "Wavefront OBJ"
  absl::string_view extensions;  // in lower case, with a dot, separated by spaces
  absl::string_view library;     // empty: none
  absl::string_view read;
  absl::string_view not_read;
  absl::string_view tried;  // real files it was tested with, besides those that tests generate
};

// `extension` is in lower case, without the dot.
bool HasExtension(const Format& format, absl::string_view extension);

// The formats that voxelctl reads itself, which need no library.
const std::vector<Format>& OwnFormats();

}  // namespace voxeld::voxelctl
