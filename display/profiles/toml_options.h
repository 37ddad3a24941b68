// TOML's values as options of a display, and its words in messages.
#pragma once

#include <toml++/toml.h>

#include <optional>
#include <string>
#include <string_view>

namespace voxeld::display {

// As a value would stand on the command line; an array's elements are joined by semicolons. Nothing of what is no text, number,
// boolean or array of these.
std::optional<std::string> OptionText(const toml::node& node);

// For messages, which are printable text: what of `text` controls terminals becomes \xNN. Keys have such characters, and what the parser
// says of a file quotes it.
std::string Printable(std::string_view text);

}  // namespace voxeld::display
