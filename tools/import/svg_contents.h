// Examines an SVG file's contents before librsvg draws it.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "tools/voxelctl/import/model.h"
#include "tools/voxelctl/import/source_file.h"

namespace voxeld::voxelctl {

struct SvgContents {
  std::vector<LeftOut> left_out;  // elements, rules, properties and functions that librsvg ignores
  uint64_t texts = 0;
  bool can_draw_texts = true;  // false if librsvg would fail on large sizes or long texts
};

// Parses `xml`, the text of `file`, without loading anything that it names. Errors: InvalidArgument
// if it is not well-formed, if its root is not <svg>, or if its elements nest or use each other so
// deep or so often that drawing them would need too much stack or time.
absl::StatusOr<SvgContents> ScanSvg(const SourceFile& file, absl::string_view xml);

}  // namespace voxeld::voxelctl
