// The contents that are sent: lines, encoded into messages beforehand.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "voxeld/v1/scene.pb.h"

namespace voxeld::bench {

// The number of bytes per line on the wire. Each line has two ends of 12 bytes (F32), and
//   24: nothing else
//   28: two U16 indices
//   30: a colour (RGB8) at each end
enum class LineForm : uint8_t { k24Bytes = 24, k28Bytes = 28, k30Bytes = 30 };

struct Lines {
  uint32_t count = 1;  // at most 32768 with indices
  LineForm form = LineForm::k28Bytes;
  double length = 0.3;  // of each line, in scene units; the scene is [-1, 1]
  uint64_t seed = 1;    // another seed gives other lines
};

// Returns lines of one length in random places and directions, all within the scene.
v1::Entity EntityOf(const Lines& lines);

v1::StreamRequest UpsertOf(const std::string& layer, const std::string& id,
                           const v1::Entity& entity);

// Lines to put as one entity, with its layer and id; BatchOf puts several into one message.
struct Put {
  std::string layer, id;
  Lines lines;
};
v1::StreamRequest BatchOf(const std::vector<Put>& puts);

v1::StreamRequest FrameBeginOf(const std::string& layer);
v1::StreamRequest FrameEndOf(const std::string& layer);

}  // namespace voxeld::bench
