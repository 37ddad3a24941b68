// Fields of the wire's messages as people type them, NAME=VALUE: what values are is told in shape_text.h.
#pragma once

#include <google/protobuf/descriptor.h>
#include <google/protobuf/message.h>

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "voxeld/v1/primitives.pb.h"

namespace voxeld::voxelctl {

struct Setting {
  std::string name, value;
};

// InvalidArgument: a value that is not understood, and what would have been.
absl::Status Wrong(absl::string_view name, absl::string_view value, absl::string_view right);
// Words, those with spaces in quotes.
absl::StatusOr<std::vector<std::string>> Words(absl::string_view text);
absl::Status SetVec3(absl::string_view name, absl::string_view text, v1::Vec3* out);
absl::Status SetColor(absl::string_view name, absl::string_view text, v1::Color* out);
// A field of any type that can be typed, of `out`.
absl::Status SetField(const google::protobuf::FieldDescriptor& field, absl::string_view text,
                      google::protobuf::Message* out);

}  // namespace voxeld::voxelctl
