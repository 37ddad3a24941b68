#include "daemon/scene/quoted.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "common/text/printable.h"

namespace voxeld::daemon {
namespace {

constexpr size_t kMostBytes = 64;

}  // namespace

std::string Quoted(std::string_view text) {
  size_t size = std::min(text.size(), kMostBytes);
  if (size < text.size()) {  // at a character boundary
    while (size > 0 && (static_cast<unsigned char>(text[size]) & 0xC0) == 0x80) --size;
  }
  return absl::StrCat("\"", EscapeQuoted(absl::string_view(text.data(), size)),
                      size < text.size() ? "…\"" : "\"");
}

}  // namespace voxeld::daemon
