// Colours as people write them: the names of CSS ("CSS Color Module Level 4"), and #rgb or #rrggbb.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "absl/strings/string_view.h"

namespace voxeld {

// Returns: 0x00RRGGBB; nullopt if `text` is not a valid colour. Ignores case.
std::optional<uint32_t> ParseColor(absl::string_view text);

// Returns: the remedy for an invalid colour: "#rrggbb or a CSS color name is expected; did you mean rebeccapurple?".
std::string ColorAdvice(absl::string_view wrong);

}  // namespace voxeld
