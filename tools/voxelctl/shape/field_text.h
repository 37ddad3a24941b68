// Parses fields of the protocol's messages as people type them, NAME=VALUE; shape_text.h describes
// the values.
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

// Returns InvalidArgument for an invalid value, with what would have been valid.
absl::Status Wrong(absl::string_view name, absl::string_view value, absl::string_view right);
// Splits a text into words; those with spaces are in quotes.
absl::StatusOr<std::vector<std::string>> Words(absl::string_view text);
absl::Status SetVec3(absl::string_view name, absl::string_view text, v1::Vec3* out);
absl::Status SetColor(absl::string_view name, absl::string_view text, v1::Color* out);
// Sets a field of `out` of any type that can be typed.
absl::Status SetField(const google::protobuf::FieldDescriptor& field, absl::string_view text,
                      google::protobuf::Message* out);

}  // namespace voxeld::voxelctl
