#include "common/toml/parse_toml.h"

#include <optional>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"
#include "common/text/printable.h"

namespace voxeld {
namespace {

struct LimitViolation {
  size_t line = 1, column = 1;
  std::string what;
};

// Scans the text without recursion. Recognises strings and comments, and otherwise only counts dots
// between two delimiters (a number has at most one) and open brackets. For text that is not TOML it
// may count too many, but never too few.
class LimitChecker {
 public:
  LimitChecker(std::string_view text, const TomlLimits& limits) : text_(text), limits_(limits) {}

  std::optional<LimitViolation> Find() {
    while (at_ < text_.size()) {
      const char c = text_[at_];
      if (c == '#') {
        SkipComment();
      } else if (c == '"' || c == '\'') {
        SkipString(c);
      } else {
        Count(c);
        if (dots_ + 1 > limits_.max_key_parts) {
          return Found(
              absl::StrCat("a dotted key has more than ", limits_.max_key_parts, " parts"));
        }
        if (depth_ > limits_.max_depth) {
          return Found(absl::StrCat("arrays and tables are nested more than ", limits_.max_depth,
                                    " levels deep"));
        }
        ++at_;
      }
    }
    return std::nullopt;
  }

 private:
  void Count(char c) {
    switch (c) {
      case '.':
        ++dots_;
        break;
      case '[':
      case '{':
        ++depth_;
        dots_ = 0;
        break;
      case ']':
      case '}':
        if (depth_ > 0) --depth_;
        dots_ = 0;
        break;
      case '\n':
      case ',':
      case '=':
        dots_ = 0;
        break;
      default:
        break;
    }
  }

  void SkipComment() {
    while (at_ < text_.size() && text_[at_] != '\n') ++at_;
  }

  void SkipString(char quote) {
    const bool long_string = Quotes(quote, 3) == 3;
    at_ += long_string ? 3 : 1;
    while (at_ < text_.size()) {
      if (quote == '"' && text_[at_] == '\\') {
        at_ += 2;
      } else if (!long_string && (text_[at_] == quote || text_[at_] == '\n')) {
        // The parser stops at a string that its line does not close, so whatever follows is not parsed.
        ++at_;
        return;
      } else if (long_string && Quotes(quote, 3) == 3) {
        // The last three quotes close it; up to two before them belong to the string.
        at_ += Quotes(quote, 5);
        return;
      } else {
        ++at_;
      }
    }
  }

  // Returns: how many times `quote` follows from here on, at most `most`.
  size_t Quotes(char quote, size_t most) const {
    size_t count = 0;
    while (count < most && at_ + count < text_.size() && text_[at_ + count] == quote) ++count;
    return count;
  }

  LimitViolation Found(std::string what) const {
    LimitViolation violation{.what = std::move(what)};
    for (const char c : text_.substr(0, at_)) {
      ++violation.column;
      if (c == '\n') ++violation.line, violation.column = 1;
    }
    return violation;
  }

  const std::string_view text_;
  const TomlLimits limits_;
  size_t at_ = 0, dots_ = 0, depth_ = 0;
};

}  // namespace

absl::StatusOr<toml::table> ParseToml(std::string_view text, const std::string& name,
                                      const TomlLimits& limits) {
  const std::string shown = EscapeControls(name);
  if (text.size() > limits.max_bytes) {
    return absl::InvalidArgumentError(absl::StrCat(shown, ": the file has ", text.size(),
                                                   " bytes; the maximum is ", limits.max_bytes));
  }
  if (const std::optional<LimitViolation> violation = LimitChecker(text, limits).Find()) {
    return absl::InvalidArgumentError(
        absl::StrCat(shown, ":", violation->line, ":", violation->column, ": ", violation->what));
  }
  try {
    return toml::parse(text, name);
  } catch (const toml::parse_error& error) {
    const toml::source_position& at = error.source().begin;
    const std::string_view what = error.description();
    return absl::InvalidArgumentError(
        absl::StrCat(shown, ":", at.line, ":", at.column, ": ",
                     EscapeControls(absl::string_view(what.data(), what.size()))));
  }
}

}  // namespace voxeld
