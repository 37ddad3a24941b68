// Messages as JSON for programs.
#pragma once

#include <google/protobuf/message.h>

#include <nlohmann/json.hpp>

namespace voxeld::voxelctl {

// Field names as in the .proto file; every field that has a value or a default,
// unset messages and oneofs left out; 64-bit integers as numbers, enums by name,
// bytes in base64, what is not finite as null.
nlohmann::ordered_json ToJson(const google::protobuf::Message& message);

// As a document on lines of its own; text that is not UTF-8 is replaced.
std::string JsonText(const nlohmann::ordered_json& json, bool one_line);

}  // namespace voxeld::voxelctl
