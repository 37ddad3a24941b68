// Checks the structure of a glTF file before a library reads it.
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

// Numbers in a buffer. Everything that they refer to exists.
struct GltfAccessor {
  uint64_t count = 0, stride = 0;
  uint64_t components = 0;  // per element: 1 to 16
  uint64_t component_size = 0;
  int component_type = 0;  // glTF's number for it
  bool normalized = false;
  absl::string_view bytes;  // empty: all elements are zero, except sparse ones

  // Elements that replace others, by index.
  uint64_t sparse_count = 0, sparse_index_size = 0;
  absl::string_view sparse_indices, sparse_values;
};

struct GltfDocument {
  nlohmann::json json;
  std::vector<GltfAccessor> accessors;
  std::vector<absl::string_view> views;
  std::deque<std::string> loaded;  // buffers outside the file
};

// Reads the JSON and the buffers of glTF text or GLB, and checks that the document is well-formed
// and nested less than 64 deep, that nodes form a forest, that accessors lie within their views and
// views within their buffers, and that all required extensions are supported. The result refers to
// `file`.
absl::StatusOr<std::unique_ptr<GltfDocument>> LoadGltfDocument(const SourceFile& file);

// Returns the bytes of a "data:" URI, or of a file that `file` names. Errors: those of
// ReadOtherFile, or InvalidArgument for bad base64; the message is a clause for FileError.
absl::StatusOr<std::string> LoadGltfUri(const SourceFile& file, const std::string& uri);

}  // namespace voxeld::voxelctl
