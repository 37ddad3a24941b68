#include "display/drivers/voxlink/decoder.h"

#include <cstring>
#include <random>
#include <string>
#include <vector>

#include "display/api/pixels.h"
#include "display/crc/crc32c.h"
#include "gtest/gtest.h"

namespace voxeld::display::voxlink {
namespace {

using Bytes = std::vector<std::byte>;

constexpr FrameLayout kLayout{.slices = 3, .width = 4, .height = 2, .sub_frames = 2};
constexpr uint32_t kMaxPayload = 64;

// Writes volumes as a driver would, into bytes.
class Writer {
 public:
  explicit Writer(uint32_t seed = 1) : random_(seed), frame_{.layout = kLayout} {
    frame_.bytes.resize(kLayout.bytes());
  }
  void Change(size_t picture) {
    for (size_t i = 0; i < kLayout.bytes_per_slice(); ++i) {
      frame_.bytes[picture * kLayout.bytes_per_slice() + i] = static_cast<std::byte>(random_());
    }
  }
  void Begin(uint64_t volume, uint64_t base, uint8_t bits = 0) {
    const Bytes bitmap(base == 0 ? 0 : 1, std::byte{bits});
    packets.Begin(out, volume, base, 6, bitmap);
  }
  void Picture(uint64_t volume, size_t picture, size_t fragment = 10) {
    const size_t size = kLayout.bytes_per_slice();
    for (size_t at = 0; at < size; at += fragment) {
      packets.Slice(
          out, volume, static_cast<uint32_t>(picture / 2), static_cast<uint16_t>(picture % 2),
          static_cast<uint32_t>(at),
          std::span(frame_.bytes).subspan(picture * size + at, std::min(fragment, size - at)));
    }
  }
  void Whole(uint64_t volume) {
    Begin(volume, 0);
    for (size_t p = 0; p < 6; ++p) {
      Change(p);
      Picture(volume, p);
    }
    packets.End(out, volume, true);
  }
  std::vector<uint8_t> Light() const { return FrameToRgb(frame_); }

  PacketWriter packets;
  Bytes out;

 private:
  std::mt19937 random_;
  SliceFrame frame_;
};

// Changes the type and flags of the last packet that was written, and corrects its header's
// checksum.
void Retype(Bytes& out, size_t at, PacketType type, uint8_t flags = 0) {
  auto header = Load<PacketHeader>(std::span(out).subspan(at));
  header.type = static_cast<uint8_t>(type);
  header.flags = flags;
  header.header_crc = Crc32c(std::as_bytes(std::span(&header, 1)).first(kHeaderCrcOffset));
  std::memcpy(out.data() + at, &header, sizeof(header));
}
// Writes a packet of any type with a payload of that many bytes.
void Any(Writer& writer, PacketType type, size_t payload, uint64_t volume = 0, uint8_t flags = 0) {
  const size_t at = writer.out.size();
  writer.packets.Slice(writer.out, volume, 0, 0, 0, Bytes(payload));
  Retype(writer.out, at, type, flags);
}

absl::Status Decode(VoxlinkDecoder& decoder, const Bytes& bytes) {
  return decoder.OnBytes(kBulkOut, bytes, 0);
}

TEST(Decoder, RebuildsWholeAndChangedVolumes) {
  Writer writer;
  VoxlinkDecoder decoder(kLayout, kMaxPayload);
  EXPECT_FALSE(decoder.TakeVolume().has_value());
  writer.Whole(4);
  ASSERT_TRUE(Decode(decoder, writer.out).ok());
  auto volume = decoder.TakeVolume();
  ASSERT_TRUE(volume.has_value());
  EXPECT_EQ(volume->volume, 4u);
  EXPECT_EQ(volume->Rgb(), writer.Light());
  EXPECT_EQ(volume->source, DecodedVolume::Source::kDecodedFromSent);
  EXPECT_FALSE(decoder.TakeVolume().has_value());

  writer.out.clear();
  writer.packets.Plain(writer.out, PacketType::kKeepalive, 0);
  writer.Begin(5, 4, 0b010010);
  for (const size_t p : {1u, 4u}) {
    writer.Change(p);
    writer.Picture(5, p);
  }
  writer.packets.End(writer.out, 5, true);
  for (const std::byte b : writer.out) {
    ASSERT_TRUE(decoder.OnBytes(kBulkOut, std::span(&b, 1), 0).ok());
  }
  volume = decoder.TakeVolume();
  ASSERT_TRUE(volume.has_value());
  EXPECT_EQ(volume->Rgb(), writer.Light());
}

TEST(Decoder, SlicesMayComeAgain) {
  Writer writer;
  VoxlinkDecoder decoder(kLayout, kMaxPayload);
  writer.Whole(1);
  writer.Change(3);
  writer.Picture(1, 3);
  writer.packets.End(writer.out, 1, true);
  ASSERT_TRUE(Decode(decoder, writer.out).ok());
  EXPECT_EQ(decoder.TakeVolume()->Rgb(), writer.Light());
}

TEST(Decoder, WhatIsForTheDeviceAloneIsPassedOver) {
  Writer writer;
  VoxlinkDecoder decoder(kLayout, kMaxPayload);
  Any(writer, PacketType::kShow, sizeof(ShowPayload));
  Any(writer, PacketType::kShow, sizeof(ShowAheadPayload), 0, kShowAhead);
  writer.packets.Plain(writer.out, PacketType::kDrop, 3);
  writer.Begin(5, 0);
  writer.Picture(5, 0);
  writer.packets.Plain(writer.out, PacketType::kAbort, 4);  // not the volume that is being filled
  for (size_t p = 1; p < 6; ++p) writer.Picture(5, p);
  writer.packets.End(writer.out, 5, true);
  ASSERT_TRUE(Decode(decoder, writer.out).ok());
  EXPECT_EQ(decoder.TakeVolume()->volume, 5u);
}

TEST(Decoder, AVolumeThatWasNotTakenIsNoneOnceTheBytesAreWrong) {
  Writer writer;
  VoxlinkDecoder decoder(kLayout, kMaxPayload);
  writer.Whole(1);
  Any(writer, PacketType::kKeepalive, 1);
  Any(writer, PacketType::kDrop, 1);                     // and the bytes after it
  writer.out.insert(writer.out.end(), 50, std::byte{});  // no longer matters
  const absl::Status status = Decode(decoder, writer.out);
  EXPECT_TRUE(absl::IsDataLoss(status));
  EXPECT_NE(status.message().find("KEEPALIVE"), std::string::npos) << "the first fault: " << status;
  EXPECT_FALSE(decoder.TakeVolume().has_value());
}

TEST(Decoder, OfTwoBrokenPayloadsTheFirstIsTold) {
  Writer writer;
  VoxlinkDecoder decoder(kLayout, kMaxPayload);
  for (const uint64_t volume : {7u, 8u}) {
    writer.packets.Slice(writer.out, volume, 0, 0, 0, Bytes(4));
    writer.out.back() ^= std::byte{1};
  }
  const absl::Status status = Decode(decoder, writer.out);
  EXPECT_NE(status.message().find("volume 7"), std::string::npos) << status;
}

TEST(Decoder, AnAbortedVolumeIsForgotten) {
  Writer writer;
  VoxlinkDecoder decoder(kLayout, kMaxPayload);
  writer.Begin(1, 0);
  writer.Picture(1, 0);
  writer.packets.Plain(writer.out, PacketType::kAbort, 1);
  writer.Whole(2);
  ASSERT_TRUE(Decode(decoder, writer.out).ok());
  EXPECT_EQ(decoder.TakeVolume()->volume, 2u);
}

struct Wrong {
  const char* what;
  void (*write)(Writer& writer);
};

class DecoderRefuses : public testing::TestWithParam<Wrong> {};

TEST_P(DecoderRefuses, WhatBreaksTheProtocol) {
  Writer writer;
  writer.Whole(1);
  VoxlinkDecoder decoder(kLayout, kMaxPayload);
  ASSERT_TRUE(Decode(decoder, writer.out).ok());
  writer.out.clear();
  GetParam().write(writer);
  const absl::Status status = Decode(decoder, writer.out);
  EXPECT_TRUE(absl::IsDataLoss(status)) << status;
  EXPECT_EQ(Decode(decoder, {}), status);  // and it stays so
  EXPECT_FALSE(decoder.TakeVolume().has_value());
}

INSTANTIATE_TEST_SUITE_P(
    All, DecoderRefuses,
    testing::Values(
        Wrong{"Garbage", [](Writer& w) { w.out.resize(50); }},
        Wrong{"BadPayload",
              [](Writer& w) {
                w.Begin(2, 0);
                w.out.back() ^= std::byte{1};
              }},
        Wrong{"MissingPacket",
              [](Writer& w) {
                Bytes lost;
                w.packets.Plain(lost, PacketType::kKeepalive, 0);
                w.packets.Plain(w.out, PacketType::kKeepalive, 0);
              }},
        Wrong{"SliceWithoutBegin", [](Writer& w) { w.Picture(2, 0); }},
        Wrong{"EndWithoutBegin", [](Writer& w) { w.packets.End(w.out, 2, true); }},
        Wrong{"NumberDoesNotAscend", [](Writer& w) { w.Begin(1, 0); }},
        Wrong{"UnknownBase", [](Writer& w) { w.Begin(3, 2, 1); }},
        Wrong{"NotAnnounced",
              [](Writer& w) {
                w.Begin(2, 1, 0b01);
                w.Picture(2, 1);
              }},
        Wrong{"PaddingBitSet", [](Writer& w) { w.Begin(2, 1, 0x40); }},
        Wrong{"WrongPictures", [](Writer& w) { w.packets.Begin(w.out, 2, 0, 5, {}); }},
        Wrong{"BitmapWithBaseZero", [](Writer& w) { w.packets.Begin(w.out, 2, 0, 6, Bytes(1)); }},
        Wrong{"SliceMissing",
              [](Writer& w) {
                w.Begin(2, 1, 0b11);
                w.Picture(2, 0);
                w.packets.End(w.out, 2, true);
              }},
        Wrong{"OutsideTheLayout",
              [](Writer& w) {
                w.Begin(2, 0);
                w.packets.Slice(w.out, 2, 3, 0, 0, Bytes(24));
              }},
        Wrong{"SubFrameOutside",
              [](Writer& w) {
                w.Begin(2, 0);
                w.packets.Slice(w.out, 2, 0, 2, 0, Bytes(24));
              }},
        Wrong{"TooLong",
              [](Writer& w) {
                w.Begin(2, 0);
                w.packets.Slice(w.out, 2, 0, 0, 20, Bytes(5));
              }},
        Wrong{"FragmentsOutOfOrder",
              [](Writer& w) {
                w.Begin(2, 0);
                w.packets.Slice(w.out, 2, 0, 0, 12, Bytes(12));
              }},
        Wrong{"EmptySlice",
              [](Writer& w) {
                w.Begin(2, 0);
                w.packets.Slice(w.out, 2, 0, 0, 0, {});
              }},
        Wrong{"EndWithPayload",
              [](Writer& w) {
                w.Begin(2, 1, 0);
                Any(w, PacketType::kEnd, 1, 2);
              }},
        Wrong{"ShowTooShort",
              [](Writer& w) { Any(w, PacketType::kShow, sizeof(ShowPayload) - 1); }},
        Wrong{"ShowAheadTooShort",
              [](Writer& w) { Any(w, PacketType::kShow, sizeof(ShowPayload), 0, kShowAhead); }},
        Wrong{"ShowTooLong",
              [](Writer& w) { Any(w, PacketType::kShow, sizeof(ShowAheadPayload)); }},
        Wrong{"AbortWithPayload", [](Writer& w) { Any(w, PacketType::kAbort, 1); }},
        Wrong{"DropWithPayload", [](Writer& w) { Any(w, PacketType::kDrop, 1); }},
        Wrong{"KeepaliveWithPayload", [](Writer& w) { Any(w, PacketType::kKeepalive, 1); }},
        Wrong{"BeginTooShort",
              [](Writer& w) { Any(w, PacketType::kBegin, sizeof(BeginPayload) - 1, 2); }},
        Wrong{"AbortedBeforeItsEnd",
              [](Writer& w) {
                w.Begin(2, 1, 0);
                w.packets.Plain(w.out, PacketType::kAbort, 2);
                w.packets.End(w.out, 2, true);
              }},
        Wrong{"UnknownType",
              [](Writer& w) { w.packets.Plain(w.out, static_cast<PacketType>(99), 0); }}),
    [](const testing::TestParamInfo<Wrong>& param) { return std::string(param.param.what); });

TEST(Decoder, TheFirstVolumeHasNoBase) {
  Writer writer;
  VoxlinkDecoder decoder(kLayout, kMaxPayload);
  writer.Begin(3, 2, 1);
  const absl::Status status = Decode(decoder, writer.out);
  EXPECT_NE(status.message().find("the base is not the last whole volume"), std::string::npos)
      << status;
}

TEST(Decoder, RefusesOtherEndpoints) {
  VoxlinkDecoder decoder(kLayout, kMaxPayload);
  EXPECT_TRUE(absl::IsDataLoss(decoder.OnBytes(2, {}, 0)));
}

TEST(Decoder, EveryTruncationGivesNothing) {
  Writer writer;
  writer.Whole(1);
  for (size_t size = 0; size < writer.out.size(); ++size) {
    VoxlinkDecoder decoder(kLayout, kMaxPayload);
    ASSERT_TRUE(decoder.OnBytes(kBulkOut, std::span(writer.out).first(size), 0).ok());
    ASSERT_FALSE(decoder.TakeVolume().has_value());
  }
}

TEST(Decoder, NoMutationPasses) {
  Writer writer;
  writer.Whole(1);
  std::mt19937 random(2);
  for (int round = 0; round < 100'000; ++round) {
    Bytes bytes = writer.out;
    switch (random() % 3) {
      case 0:
        bytes[random() % bytes.size()] ^= static_cast<std::byte>(1 + random() % 255);
        break;
      case 1:
        bytes.erase(bytes.begin() + static_cast<ptrdiff_t>(random() % bytes.size()));
        break;
      default:
        bytes.insert(bytes.begin() + static_cast<ptrdiff_t>(random() % bytes.size()),
                     static_cast<std::byte>(random()));
        break;
    }
    VoxlinkDecoder decoder(kLayout, kMaxPayload);
    const absl::Status status = Decode(decoder, bytes);
    ASSERT_TRUE(status.ok() || absl::IsDataLoss(status));
    ASSERT_FALSE(decoder.TakeVolume().has_value());
  }
}

}  // namespace
}  // namespace voxeld::display::voxlink
