// The structure of a glTF file, checked before a library reads it.
#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "tools/voxelctl/import/source_file.h"

namespace voxeld::voxelctl {

// Numbers in a buffer. All that they refer to is there.
struct GltfAccessor {
  uint64_t count = 0, stride = 0;
  uint64_t components = 0;  // of an element: 1 to 16
  uint64_t component_size = 0;
  int component_type = 0;  // as glTF numbers them
  bool normalized = false;
  absl::string_view bytes;  // empty: all elements are zero, but those that are sparse

  // Elements that replace others, by their number.
  uint64_t sparse_count = 0, sparse_index_size = 0;
  absl::string_view sparse_indices, sparse_values;
};

struct GltfDocument {
  nlohmann::json json;
  std::vector<GltfAccessor> accessors;
  std::vector<absl::string_view> views;
  std::deque<std::string> loaded;  // buffers that are not in the file
};

// Reads the JSON and the buffers of glTF text or GLB, and checks them: well-formed, nested less than 64 deep; nodes form a forest;
// accessors lie within their views, views within their buffers; extensions that it requires are ones that can be read. The result
// refers to `file`.
absl::StatusOr<std::unique_ptr<GltfDocument>> LoadGltfDocument(const SourceFile& file);

// The bytes of a "data:" URI, or of a file that `file` names. Errors as those of ReadOtherFile, or InvalidArgument for bad base64; the message
// is a clause for FileError.
absl::StatusOr<std::string> LoadGltfUri(const SourceFile& file, const std::string& uri);

}  // namespace voxeld::voxelctl
