#include "common/text/printable.h"

#include <cstdint>
#include <optional>
#include <string>

#include "absl/strings/str_format.h"
#include "absl/strings/string_view.h"

namespace voxeld {
namespace {

// Decodes the code point at the front of `text`. Returns: its length in bytes, or 0 if it is not UTF-8.
size_t Decode(absl::string_view text, uint32_t* code) {
  const auto byte = [&](size_t i) { return static_cast<uint8_t>(text[i]); };
  const uint8_t first = byte(0);
  if (first < 0x80) {
    *code = first;
    return 1;
  }
  const size_t length = first >= 0xf0 ? 4 : first >= 0xe0 ? 3 : 2;
  if (first < 0xc2 || first > 0xf4 || text.size() < length) return 0;
  uint32_t value = first & (0x7fu >> length);
  for (size_t i = 1; i < length; ++i) {
    if ((byte(i) & 0xc0) != 0x80) return 0;
    value = value << 6 | (byte(i) & 0x3fu);
  }
  static constexpr uint32_t kLeast[] = {0, 0, 0x80, 0x800, 0x10000};
  if (value < kLeast[length] || value > 0x10ffff || (value >= 0xd800 && value < 0xe000)) return 0;
  *code = value;
  return length;
}

bool IsAsciiControl(uint32_t code) { return code < 0x20 || code == 0x7f; }

bool Harmful(uint32_t code) {
  return code < 0x20 || (code >= 0x7f && code < 0xa0) || (code >= 0x200b && code <= 0x200f) ||
         (code >= 0x2028 && code <= 0x202e) || (code >= 0x2066 && code <= 0x2069) ||
         code == 0xfeff || code == 0x061c;
}

// Calls append(&out, code, bytes) with each code point of `text`, and with no code for a byte that is not UTF-8.
template <typename Append>
std::string Escaped(absl::string_view text, Append append) {
  std::string out;
  out.reserve(text.size());
  while (!text.empty()) {
    uint32_t code = 0;
    const size_t length = Decode(text, &code);
    if (length == 0) {
      append(&out, std::nullopt, text.substr(0, 1));
      text.remove_prefix(1);
    } else {
      append(&out, std::optional(code), text.substr(0, length));
      text.remove_prefix(length);
    }
  }
  return out;
}

void AppendPrintable(std::string* out, std::optional<uint32_t> code, absl::string_view bytes) {
  if (!code) {
    absl::StrAppendFormat(out, "\\x%02x", static_cast<uint8_t>(bytes.front()));
  } else if (*code == '\\') {
    *out += "\\\\";
  } else if (Harmful(*code)) {
    absl::StrAppendFormat(out, "\\u{%x}", *code);
  } else {
    out->append(bytes.data(), bytes.size());
  }
}

void AppendWithoutControls(std::string* out, std::optional<uint32_t> code,
                           absl::string_view bytes) {
  if (code && IsAsciiControl(*code)) {
    absl::StrAppendFormat(out, "\\x%02x", *code);
  } else if (code == '\\') {
    *out += '\\';
  } else {
    AppendPrintable(out, code, bytes);
  }
}

}  // namespace

std::string EscapeForTerminal(absl::string_view text) { return Escaped(text, AppendPrintable); }

std::string EscapeControls(absl::string_view text) { return Escaped(text, AppendWithoutControls); }

std::string EscapeLines(absl::string_view text) {
  return Escaped(text, [](std::string* out, std::optional<uint32_t> code, absl::string_view bytes) {
    if (code == '\n') {
      *out += '\n';
    } else {
      AppendWithoutControls(out, code, bytes);
    }
  });
}

std::string EscapeQuoted(absl::string_view text) {
  return Escaped(text, [](std::string* out, std::optional<uint32_t> code, absl::string_view bytes) {
    switch (code.value_or(0)) {
      case '"':
        *out += "\\\"";
        break;
      case '\n':
        *out += "\\n";
        break;
      case '\r':
        *out += "\\r";
        break;
      case '\t':
        *out += "\\t";
        break;
      default:
        if (code && IsAsciiControl(*code)) {
          absl::StrAppendFormat(out, "\\x%02x", *code);
        } else {
          AppendPrintable(out, code, bytes);
        }
    }
  });
}

std::string EscapeJson(absl::string_view json) {
  return Escaped(json, [](std::string* out, std::optional<uint32_t> code, absl::string_view bytes) {
    // No harmful character is above U+FFFF, so that none needs a surrogate pair.
    if (code && *code >= 0x7f && Harmful(*code)) {
      absl::StrAppendFormat(out, "\\u%04x", *code);
    } else {
      out->append(bytes.data(), bytes.size());
    }
  });
}

bool IsUtf8(absl::string_view text) {
  uint32_t code = 0;
  while (!text.empty()) {
    const size_t length = Decode(text, &code);
    if (length == 0) return false;
    text.remove_prefix(length);
  }
  return true;
}

}  // namespace voxeld
