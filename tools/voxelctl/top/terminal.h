// The terminal as a whole, and single keys. terminal.cc alone knows ncurses.
#pragma once

#include <memory>
#include <vector>

#include "tools/voxelctl/top/top_view.h"

namespace voxeld::voxelctl {

enum class TopKey : uint8_t { kNone, kQuit, kPause, kNext, kPrevious, kResize };

// Takes standard input and output over, and gives them back as they were: when it goes, and when a signal that ends the
// process comes first. One at a time, for one thread.
class Terminal {
 public:
  // Null if this is no terminal that it knows how to speak to.
  static std::unique_ptr<Terminal> Open(bool colors);
  ~Terminal();
  Terminal(const Terminal&) = delete;
  Terminal& operator=(const Terminal&) = delete;

  int width() const;
  int height() const;

  // In place of what was there.
  void Show(const std::vector<TopLine>& lines);

  // The next key, or kNone after so long.
  TopKey Wait(int milliseconds);

 private:
  Terminal() = default;
};

}  // namespace voxeld::voxelctl
