// Full-screen output and single keys. Only terminal.cc uses ncurses.
#pragma once

#include <memory>
#include <vector>

#include "tools/voxelctl/top/top_view.h"

namespace voxeld::voxelctl {

enum class TopKey : uint8_t { kNone, kQuit, kPause, kNext, kPrevious, kResize };

// Takes over standard input and output, and restores them on destruction and on a fatal signal. At
// most one object at a time, bound to one thread.
class Terminal {
 public:
  // Returns null if the terminal is not supported.
  static std::unique_ptr<Terminal> Open(bool colors);
  ~Terminal();
  Terminal(const Terminal&) = delete;
  Terminal& operator=(const Terminal&) = delete;

  int width() const;
  int height() const;

  // Replaces the shown lines.
  void Show(const std::vector<TopLine>& lines);

  // Returns the next key, or kNone after that time.
  TopKey Wait(int milliseconds);

 private:
  Terminal() = default;
};

}  // namespace voxeld::voxelctl
