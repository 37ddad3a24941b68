#include "tools/voxelctl/commands/console.h"

#include <algorithm>
#include <cstdlib>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/text/printable.h"

namespace voxeld::voxelctl {

bool Console::Data(absl::string_view text) {
  EndProgress();
  out_ << (json_ ? EscapeJson(text) : std::string(text)) << std::flush;
  return out_.good();
}

void Console::Say(absl::string_view text) {
  EndProgress();
  err_ << EscapeLines(text) << std::endl;
}

void Console::Swatches(const std::vector<std::array<uint8_t, 3>>& colors) {
  if (!live_ || std::getenv("NO_COLOR") != nullptr) return;
  EndProgress();
  for (const auto& [red, green, blue] : colors)
    err_ << absl::StrFormat("\x1b[48;2;%d;%d;%dm ", red, green, blue);
  err_ << "\x1b[0m" << std::endl;
}

void Console::Progress(absl::string_view text) {
  if (!live_) return;
  err_ << absl::StrCat("\r\x1b[K", EscapeLines(text)) << std::flush;
  drawn_ = true;
}

void Console::ProgressBar(absl::string_view what, double fraction, absl::string_view detail) {
  constexpr int kWidth = 28;
  const int filled = static_cast<int>(std::clamp(fraction, 0.0, 1.0) * kWidth);
  Progress(absl::StrFormat("%-10s [%s%s] %3.0f %%  %s", what,
                           std::string(static_cast<size_t>(filled), '#'),
                           std::string(static_cast<size_t>(kWidth - filled), ' '),
                           std::clamp(fraction, 0.0, 1.0) * 100, detail));
}

void Console::EndProgress() {
  if (!drawn_) return;
  err_ << "\r\x1b[K" << std::flush;
  drawn_ = false;
}

}  // namespace voxeld::voxelctl
