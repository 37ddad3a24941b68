// The strict reading of a driver's bytes, for captures: divided anywhere it gives the same result,
// and an error stays.

#include <cstdint>
#include <optional>
#include <vector>

#include "display/drivers/voxlink/decoder.h"
#include "tests/fuzz/exchanges.h"
#include "tests/fuzz/expect.h"
#include "tests/fuzz/script.h"
#include "tests/fuzz/voxlink/packets.h"

namespace voxeld::fuzz {
namespace {

using display::DecodedVolume;
using display::voxlink::VoxlinkDecoder;

constexpr display::FrameLayout kLayouts[] = {
    {.slices = 3, .width = 4, .height = 2, .sub_frames = 2},
    {.slices = 17, .width = 2, .height = 2, .sub_frames = 1},
    {.slices = 1,
     .width = 16,
     .height = 4,
     .sub_frames = 1,
     .format = display::PixelFormat::kRgb332},
};
constexpr uint32_t kMostPayload = 64;

void CheckVolume(const DecodedVolume& volume, const display::FrameLayout& layout) {
  EXPECT_THAT_HOLDS(volume.volume != 0);
  EXPECT_THAT_HOLDS(volume.pictures.size() == layout.pictures());
  for (const display::Picture& picture : volume.pictures) {
    EXPECT_THAT_HOLDS(picture != nullptr && picture->size() == layout.bytes_per_slice());
  }
  volume.Rgb();
}

void Run(Script script) {
  const display::FrameLayout layout = kLayouts[script.Below(3)];
  VoxlinkDecoder decoder(layout, kMostPayload), whole(layout, kMostPayload);
  display::voxlink::PacketWriter writer;
  std::vector<std::byte> all;
  std::optional<DecodedVolume> last;
  absl::Status status;
  // All packets go to one endpoint.
  VoxlinkDecoder other(layout, kMostPayload);
  ExpectSays(other.OnBytes(display::voxlink::kInterruptIn, {}, 0));
  while (!script.done() && all.size() < 64 << 10) {
    std::vector<std::byte> bytes;
    for (int i = script.Byte() % 8; i >= 0; --i) AppendPacket(script, writer, bytes);
    all.insert(all.end(), bytes.begin(), bytes.end());
    const size_t cut = bytes.empty() ? 0 : script.Byte() % bytes.size();
    for (const auto& piece : {std::span(bytes).first(cut), std::span(bytes).subspan(cut)}) {
      const absl::Status now = decoder.OnBytes(display::voxlink::kBulkOut, piece, 0);
      ExpectSays(now);
      CountExchange(ExchangeKind::kDecoded, now.ok());
      EXPECT_THAT_HOLDS(status.ok() || now == status, "a fault does not go away");
      status = now;
      if (std::optional<DecodedVolume> volume = decoder.TakeVolume()) {
        CheckVolume(*volume, layout);
        EXPECT_THAT_HOLDS(!decoder.TakeVolume().has_value(), "a volume comes once");
        last = std::move(volume);
      }
    }
  }
  const absl::Status at_once = whole.OnBytes(display::voxlink::kBulkOut, all, 0);
  // The message says between which pieces the error was.
  EXPECT_THAT_HOLDS(at_once.code() == status.code(), at_once.ToString(), " or ", status.ToString());
  if (!status.ok()) return;
  const std::optional<DecodedVolume> newest = whole.TakeVolume();
  EXPECT_THAT_HOLDS(newest.has_value() == last.has_value());
  if (newest.has_value()) {
    EXPECT_THAT_HOLDS(newest->volume == last->volume && newest->Rgb() == last->Rgb());
  }
}

}  // namespace
}  // namespace voxeld::fuzz

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  voxeld::fuzz::Run(voxeld::fuzz::Script(data, size));
  return 0;
}
