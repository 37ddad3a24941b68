// Packets to controllers, read back for captures: any bytes may be read, and what was written is
// what is read.

#include <algorithm>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "display/drivers/network/decoder.h"
#include "display/drivers/network/packets.h"
#include "tests/fuzz/exchanges.h"
#include "tests/fuzz/expect.h"
#include "tests/fuzz/script.h"

namespace voxeld::fuzz {
namespace {

namespace network = display::network;

void Run(Script script) {
  network::StreamOptions stream;
  stream.protocol = static_cast<network::Protocol>(script.Byte() % 4);
  stream.first_universe = 1 + script.Byte() % 4;
  stream.priority = static_cast<uint8_t>(script.Byte() % 201);
  stream.sync_universe = script.Byte() % 3;
  const int32_t slices = 1 + script.Byte() % 4, pixels = 1 + script.Byte() % 32;
  EXPECT_THAT_HOLDS(pixels <= network::MostPixels(stream.protocol) &&
                    slices <= network::MostSlices(stream));
  const display::FrameLayout layout{.slices = slices, .width = pixels, .height = 1};
  network::NetworkDecoder decoder(layout, stream, {});
  network::PacketWriter writer(stream, pixels);
  absl::Status status;
  while (!script.done()) {
    std::vector<std::byte> packet;
    std::vector<uint8_t> rgb;
    int32_t slice = 0;
    bool last = false;
    const uint8_t what = script.Byte() % 8;
    if (what < 3) {
      slice = script.Byte() % slices;
      last = script.Flag();
      rgb.assign(static_cast<size_t>(pixels) * 3, script.Byte());
      packet = writer.Pixels(slice, rgb, last);
      if (what == 2) {  // damaged
        packet.at(script.Below(65536) % packet.size()) = static_cast<std::byte>(script.Byte());
      }
    } else if (what == 3) {
      packet = writer.Sync();
    } else if (what == 4) {
      rgb.assign(static_cast<size_t>(pixels) * 3, 0);
      packet = writer.End(0, rgb);
    } else if (what == 5) {
      writer.Leap();
    } else {
      for (const char c : script.Text()) packet.push_back(static_cast<std::byte>(c));
    }
    packet.shrink_to_fit();
    const auto read = network::Read(stream, slices, pixels, packet);
    if (read.has_value()) {
      EXPECT_THAT_HOLDS(read->slice >= 0 && read->slice < slices);
      if (read->kind == network::ReadPacket::Kind::kPixels) {
        EXPECT_THAT_HOLDS(read->rgb.size() == static_cast<size_t>(pixels) * 3);
      }
    }
    if (what < 2) {
      EXPECT_THAT_HOLDS(read.has_value(), "what was written is not read");
      EXPECT_THAT_HOLDS(read->kind == network::ReadPacket::Kind::kPixels && read->slice == slice);
      EXPECT_THAT_HOLDS(std::ranges::equal(read->rgb, std::as_bytes(std::span(rgb))));
    }
    const absl::Status now = decoder.OnBytes(0, packet, 0);
    ExpectSays(now);
    CountExchange(ExchangeKind::kNetwork, read.has_value());
    if (status.ok()) EXPECT_THAT_HOLDS(now.ok() || !read.has_value(), now.ToString());
    status = now;
    if (const auto volume = decoder.TakeVolume()) {
      EXPECT_THAT_HOLDS(volume->pictures.size() == layout.pictures());
      volume->Rgb();
    }
  }
}

}  // namespace
}  // namespace voxeld::fuzz

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  voxeld::fuzz::Run(voxeld::fuzz::Script(data, size));
  return 0;
}
