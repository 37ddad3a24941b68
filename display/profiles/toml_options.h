// TOML's values as options of a display.
#pragma once

#include <toml++/toml.h>

#include <optional>
#include <string>

namespace voxeld::display {

// As a value would stand on the command line; an array's elements are joined by semicolons. Nothing of what is no text, number,
// boolean or array of these.
std::optional<std::string> OptionText(const toml::node& node);

}  // namespace voxeld::display
