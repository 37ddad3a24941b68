// What is sent: lines, put into messages beforehand.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "voxeld/v1/scene.pb.h"

namespace voxeld::bench {

// How many bytes a line takes on the wire: two ends of 12 (F32), and
//   24: no more
//   28: two U16 indices
//   30: a colour (RGB8) at each end
enum class LineForm : uint8_t { k24Bytes = 24, k28Bytes = 28, k30Bytes = 30 };

struct Lines {
  uint32_t count = 1;  // at most 32768 with indices
  LineForm form = LineForm::k28Bytes;
  double length = 0.3;  // of each, in scene units; the scene is [-1, 1]
  uint64_t seed = 1;    // others give other lines
};

// Lines of one length in random places and directions, all of them within the scene.
v1::Entity EntityOf(const Lines& lines);

v1::StreamRequest UpsertOf(const std::string& layer, const std::string& id,
                           const v1::Entity& entity);

// An entity a layer and id, in one message.
struct Put {
  std::string layer, id;
  Lines lines;
};
v1::StreamRequest BatchOf(const std::vector<Put>& puts);

v1::StreamRequest FrameBeginOf(const std::string& layer);
v1::StreamRequest FrameEndOf(const std::string& layer);

}  // namespace voxeld::bench
