#include "display/profiles/toml_options.h"

#include <sstream>
#include <type_traits>
#include <utility>
#include <vector>

#include "absl/strings/str_join.h"

namespace voxeld::display {

std::optional<std::string> OptionText(const toml::node& node) {
  if (auto text = node.value_exact<std::string>()) return text;
  if (node.is_number() || node.is_boolean()) {
    std::ostringstream out;
    node.visit([&out](const auto& value) {
      using Value = std::decay_t<decltype(value)>;
      if constexpr (toml::is_value<Value>) out << toml::toml_formatter{value};
    });
    return out.str();
  }
  const toml::array* items = node.as_array();
  if (items == nullptr) return {};
  std::vector<std::string> texts;
  for (const toml::node& item : *items) {
    std::optional<std::string> text = item.is_array() ? std::nullopt : OptionText(item);
    if (!text.has_value()) return {};
    texts.push_back(*std::move(text));
  }
  return absl::StrJoin(texts, ";");
}

}  // namespace voxeld::display
