#include "display/drivers/fadecandy/decoder.h"

#include <vector>

#include "display/drivers/fadecandy/packets.h"
#include "gtest/gtest.h"

namespace voxeld::display::fadecandy {
namespace {

TransferBytes Frame(int value, size_t begin = 0, size_t end = kFramePackets) {
  TransferBytes bytes;
  const std::vector<std::byte> rgb(kFrameBytes, static_cast<std::byte>(value));
  AppendFrame(bytes, rgb, begin, end);
  return bytes;
}

class FadecandyDecoding : public testing::Test {
 protected:
  bool Takes(const TransferBytes& bytes, size_t device) {
    return decoder_.OnBytes(kBulkOut, bytes, device).ok();
  }
  // Returns the first byte of each board's picture; empty without a volume.
  std::vector<int> Taken() {
    const std::optional<DecodedVolume> volume = decoder_.TakeVolume();
    std::vector<int> values;
    if (!volume.has_value()) return values;
    EXPECT_EQ(volume->layout.slices, 2);
    for (const Picture& picture : volume->pictures) {
      values.push_back(std::to_integer<int>(picture->front()));
      EXPECT_EQ(*picture, std::vector<std::byte>(kFrameBytes, picture->front()));
    }
    return values;
  }

  FadecandyDecoder decoder_{{.slices = 2, .width = kPixels, .height = 1}};
};

TEST_F(FadecandyDecoding, AVolumeIsAFrameOfEachBoard) {
  EXPECT_TRUE(Takes(Frame(1), 0));
  EXPECT_TRUE(Taken().empty());
  EXPECT_TRUE(Takes(Frame(2), 1));
  EXPECT_EQ(Taken(), (std::vector<int>{1, 2}));
  EXPECT_TRUE(Taken().empty());
  EXPECT_TRUE(Takes(Frame(3, 0, kLastPacket), 1));
  EXPECT_TRUE(Taken().empty());
  EXPECT_TRUE(Takes(Frame(3, kLastPacket, kFramePackets), 1));
  EXPECT_EQ(Taken(), (std::vector<int>{1, 3}));
}

TEST_F(FadecandyDecoding, PacketsMayComeAgain) {
  EXPECT_TRUE(Takes(Frame(9, 0, 7), 0));
  EXPECT_TRUE(Takes(Frame(1, 0, kLastPacket), 0));
  EXPECT_TRUE(Takes(Frame(1, 3, 4), 0));
  EXPECT_TRUE(Takes(Frame(1, kLastPacket, kFramePackets), 0));
  EXPECT_TRUE(Takes(Frame(2), 1));
  EXPECT_EQ(Taken(), (std::vector<int>{1, 2}));
}

TEST_F(FadecandyDecoding, TablesAndConfigurationPassBy) {
  TransferBytes bytes;
  AppendConfig(bytes, 3);
  AppendLut(bytes, Lut{});
  EXPECT_TRUE(Takes(bytes, 1));
  EXPECT_TRUE(Takes(Frame(1), 0) && Takes(Frame(2), 1));
  EXPECT_EQ(Taken(), (std::vector<int>{1, 2}));
}

TEST_F(FadecandyDecoding, AFrameWithoutAllItsPacketsIsToldAndForGood) {
  EXPECT_TRUE(Takes(Frame(1, 0, 20), 0));
  const absl::Status status = decoder_.OnBytes(kBulkOut, Frame(1, kLastPacket, kFramePackets), 0);
  EXPECT_EQ(status.code(), absl::StatusCode::kDataLoss);
  EXPECT_EQ(status.message(),
            "packet 24 of type 0 for board 0: it ends a frame of which 4 are missing");
  EXPECT_FALSE(Takes(Frame(1), 0));
  EXPECT_FALSE(Takes(Frame(1), 1));
  EXPECT_TRUE(Taken().empty());
}

TEST_F(FadecandyDecoding, WhatIsNoPacketIsTold) {
  const auto wrong = [](uint8_t endpoint, size_t size, int control, size_t device) {
    TransferBytes bytes(size);
    if (size > 0) bytes[0] = static_cast<std::byte>(control);
    FadecandyDecoder decoder({.slices = 2, .width = kPixels, .height = 1});
    return decoder.OnBytes(endpoint, bytes, device).code() == absl::StatusCode::kDataLoss;
  };
  EXPECT_FALSE(wrong(1, 64, 0, 1));
  EXPECT_TRUE(wrong(2, 64, 0, 1));
  EXPECT_TRUE(wrong(1, 63, 0, 1));
  EXPECT_TRUE(wrong(1, 65, 0, 1));
  EXPECT_TRUE(wrong(1, 64, 0, 2));
  EXPECT_TRUE(wrong(1, 64, 0xC0, 0));
  EXPECT_TRUE(wrong(1, 64, 0x19, 0));
  EXPECT_TRUE(wrong(1, 64, 0x59, 0));
}

}  // namespace
}  // namespace voxeld::display::fadecandy
