// A voxlink device in a session, whose events so far have been read.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "tests/display/emulator/bench.h"

namespace voxeld::display::emulator {

inline std::vector<voxlink::EventType> Types(const std::vector<SeenEvent>& events) {
  std::vector<voxlink::EventType> types;
  for (const SeenEvent& event : events) types.push_back(event.type());
  return types;
}

class Device : public testing::Test {
 protected:
  Device() {
    bench_.StartSession();
    bench_.Events();
  }
  void Keep() {
    std::vector<std::byte> out;
    bench_.writer().Plain(out, voxlink::PacketType::kKeepalive, 0);
    bench_.Bulk(out);
  }
  // Advances the time with a host that sends keepalives.
  void PassAlive(sync::TimeNs duration) {
    for (sync::TimeNs left = duration; left > 0; left -= 50 * sync::kMillisecond) {
      bench_.Pass(std::min(left, 50 * sync::kMillisecond));
      Keep();
    }
  }
  void ExpectVolumeEvent(const SeenEvent& event, voxlink::EventType type, uint64_t volume,
                         voxlink::Reason reason) {
    EXPECT_EQ(event.type(), type);
    EXPECT_EQ(event.As<voxlink::VolumeEvent>().volume, volume);
    EXPECT_EQ(event.As<voxlink::VolumeEvent>().reason, static_cast<uint32_t>(reason));
  }
  voxlink::ErrorCode CodeOf(const SeenEvent& event) {
    EXPECT_EQ(event.type(), voxlink::EventType::kError);
    return static_cast<voxlink::ErrorCode>(event.As<voxlink::ErrorEvent>().code);
  }
  Bench bench_;
};

}  // namespace voxeld::display::emulator
