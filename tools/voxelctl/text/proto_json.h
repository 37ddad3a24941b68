// Converts messages to JSON for programs.
#pragma once

#include <google/protobuf/message.h>

#include <nlohmann/json.hpp>

namespace voxeld::voxelctl {

// Uses field names as in the .proto file. Includes every field that has a value or a default; unset
// messages and oneofs are left out. 64-bit integers are numbers, enums are names, bytes are base64,
// and non-finite numbers are null.
nlohmann::ordered_json ToJson(const google::protobuf::Message& message);

// Returns a document that ends with a newline; text that is not UTF-8 is replaced.
std::string JsonText(const nlohmann::ordered_json& json, bool one_line);

}  // namespace voxeld::voxelctl
