// The tool's output.
#pragma once

#include <array>
#include <cstdint>
#include <ostream>
#include <string>
#include <vector>

#include "absl/strings/string_view.h"

namespace voxeld::voxelctl {

// Writes data to `out` and messages to `err`. Escapes control characters in messages and in JSON,
// so that untrusted text cannot control the terminal. Not thread-safe.
class Console {
 public:
  // `live` means that err is a terminal, so a line may be redrawn.
  Console(std::ostream& out, std::ostream& err, bool json, bool live)
      : out_(out), err_(err), json_(json), live_(live) {}

  bool json() const { return json_; }
  bool live() const { return live_; }

  // Writes data and flushes, so that a reader sees whole documents and lines. Returns false if the
  // reader has closed the output.
  bool Data(absl::string_view text);

  // Writes a line of text. Ends a progress line first.
  void Say(absl::string_view text);

  // Writes a line of colours (red, green, blue), if err is a terminal.
  void Swatches(const std::vector<std::array<uint8_t, 3>>& colors);

  // Replaces the previous progress line; does nothing unless live().
  void Progress(absl::string_view text);
  // Draws a bar: "sending  [#####     ]  50 %  1.2 of 2.4 MB". `fraction` is from 0 to 1.
  void ProgressBar(absl::string_view what, double fraction, absl::string_view detail);
  void EndProgress();

 private:
  std::ostream& out_;
  std::ostream& err_;
  const bool json_, live_;
  bool drawn_ = false;
};

}  // namespace voxeld::voxelctl
