#include "daemon/config/display_config.h"

#include <utility>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "common/text/printable.h"

namespace voxeld::daemon {
namespace {

constexpr size_t kNameBytes = 64;

absl::string_view View(std::string_view text) { return {text.data(), text.size()}; }

// Escapes `text` for messages, which are one line of printable text.
std::string Shown(absl::string_view text) { return EscapeQuoted(text); }

absl::Status Wrong(std::string_view text, const std::string& why) {
  return absl::InvalidArgumentError(
      absl::StrCat("--display \"", Shown(View(text)), "\" ", why,
                   "; give NAME=DRIVER[,KEY=VALUE…], such as rotor=simulated,geometry=rotor"));
}

}  // namespace

absl::Status CheckDisplayName(std::string_view name) {
  bool right = !name.empty() && name.size() <= kNameBytes &&
               absl::ascii_isalnum(static_cast<unsigned char>(name.front()));
  for (const char c : name) {
    right = right && (absl::ascii_isalnum(static_cast<unsigned char>(c)) || c == '-' || c == '_' ||
                      c == '.');
  }
  if (right) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat("the display name \"", Shown(View(name)), "\" is not 1 to ", kNameBytes,
                   " letters, digits, '-', '_' or '.', beginning with a letter or digit"));
}

absl::StatusOr<DisplayConfig> ParseDisplayOption(std::string_view text) {
  DisplayConfig display;
  display.source = absl::StrCat("--display ", View(text));
  bool first = true;
  for (const absl::string_view item : absl::StrSplit(View(text), ',')) {
    const std::pair<std::string, std::string> pair = absl::StrSplit(item, absl::MaxSplits('=', 1));
    const auto& [key, value] = pair;
    const bool has_value = item.find('=') != absl::string_view::npos;
    if (std::exchange(first, false)) {
      if (!has_value || value.empty()) return Wrong(text, "names no driver");
      if (absl::Status status = CheckDisplayName(key); !status.ok()) {
        return Wrong(text, absl::StrCat("is refused: ", status.message()));
      }
      display.name = key;
      display.driver = value;
      continue;
    }
    if (key.empty() || !has_value) {
      return Wrong(text, absl::StrCat("has \"", Shown(item), "\", which is no KEY=VALUE"));
    }
    if (!display.options.emplace(key, value).second) {
      return Wrong(text, absl::StrCat("gives ", Shown(key), " twice"));
    }
  }
  return display;
}

}  // namespace voxeld::daemon
