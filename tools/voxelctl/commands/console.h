// Where the tool writes.
#pragma once

#include <array>
#include <cstdint>
#include <ostream>
#include <string>
#include <vector>

#include "absl/strings/string_view.h"

namespace voxeld::voxelctl {

// Writes data to `out` and messages to `err`. Escapes control characters in messages and in JSON, so that untrusted text cannot
// control the terminal. Not thread-safe.
class Console {
 public:
  // `live`: err is a terminal, so a line may be drawn again and again.
  Console(std::ostream& out, std::ostream& err, bool json, bool live)
      : out_(out), err_(err), json_(json), live_(live) {}

  bool json() const { return json_; }
  bool live() const { return live_; }

  // Data; flushed, so that a reader sees whole documents and lines. False if nobody reads any more.
  bool Data(absl::string_view text);

  // A line of words. Ends a progress line first.
  void Say(absl::string_view text);

  // A line of colours (red, green, blue), if err is a terminal.
  void Swatches(const std::vector<std::array<uint8_t, 3>>& colors);

  // Draws over the progress line before; nothing unless live().
  void Progress(absl::string_view text);
  // A bar: "sending  [#####     ]  50 %  1.2 of 2.4 MB". `fraction` from 0 to 1.
  void ProgressBar(absl::string_view what, double fraction, absl::string_view detail);
  void EndProgress();

 private:
  std::ostream& out_;
  std::ostream& err_;
  const bool json_, live_;
  bool drawn_ = false;
};

}  // namespace voxeld::voxelctl
