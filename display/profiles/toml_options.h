// Converts TOML values to options of a display.
#pragma once

#include <toml++/toml.h>

#include <optional>
#include <string>

namespace voxeld::display {

// Returns the value as written on the command line; an array's elements are joined by semicolons.
// Returns nothing if the value is not a text, number, boolean or array of these.
std::optional<std::string> OptionText(const toml::node& node);

}  // namespace voxeld::display
