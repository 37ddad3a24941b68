// The final report of play.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "tools/voxelctl/commands/console.h"
#include "tools/voxelctl/connection/scene_session.h"
#include "tools/voxelctl/import/model.h"
#include "tools/voxelctl/scene/color_by.h"

namespace voxeld::voxelctl {

struct PlayedFile {
  std::string path, format, note;
  std::vector<LeftOut> left_out;
  uint64_t entities = 1;
  uint64_t vertices = 0, indices = 0, samples = 0, objects = 0, bytes = 0;
};

struct PlaySummary {
  std::string layer;
  uint64_t owner = 0;
  std::optional<Legend> legend;
  std::vector<PlayedFile> files;
  int64_t duration_ns = 0;
  uint64_t frames = 0, frames_skipped = 0;  // of a spin; skipped while the displays were late
  bool still_up = false;
  client::Tally tally;
  std::vector<int64_t> latencies_ns;
};

// Writes JSON as data, or lines of text.
void Report(PlaySummary summary, Console& console);

}  // namespace voxeld::voxelctl
