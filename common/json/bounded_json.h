// Parses untrusted JSON with a limit on its nesting depth, so that recursive code cannot overflow the stack.
#pragma once

#include <nlohmann/json.hpp>
#include <string_view>

#include "common/json/json_depth.h"

namespace voxeld {

// Returns: the document, or a discarded value (is_discarded(); of no other type) if `text` is not JSON or is nested deeper than
// kMaxJsonDepth.
inline nlohmann::json ParseBoundedJson(std::string_view text) {
  if (JsonDepth(text) > kMaxJsonDepth) return nlohmann::json::value_t::discarded;
  return nlohmann::json::parse(text, nullptr, false);
}

}  // namespace voxeld
