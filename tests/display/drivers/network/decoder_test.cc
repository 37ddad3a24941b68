// Tests which packets of a stream are read, for captures, and which are ignored.
#include "display/drivers/network/decoder.h"

#include <algorithm>
#include <cstdint>
#include <string>
#include <vector>

#include "display/drivers/network/packets.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace voxeld::display::network {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using Bytes = std::vector<std::byte>;

constexpr FrameLayout kLayout{.slices = 2, .width = 2, .height = 1};

StreamOptions StreamOf(Protocol protocol, int32_t sync = 0) {
  return {.protocol = protocol, .first_universe = 5, .sync_universe = sync};
}

std::vector<uint8_t> Light(uint8_t from) {
  std::vector<uint8_t> out(6);
  for (uint8_t i = 0; i < 6; ++i) out[i] = static_cast<uint8_t>(from + i);
  return out;
}

void Put16(Bytes& packet, size_t at, size_t value) {
  packet[at] = static_cast<std::byte>(value >> 8);
  packet[at + 1] = static_cast<std::byte>(value);
}

class Decoders : public testing::TestWithParam<Protocol> {};

TEST_P(Decoders, GiveBackWhatWasSentInTheLightsOrder) {
  const StreamOptions stream = StreamOf(GetParam(), GetParam() == Protocol::kE131 ? 7 : 0);
  PacketWriter writer(stream, 2);
  NetworkDecoder decoder(kLayout, stream, {2, 0, 1});  // sent as B, R, G
  EXPECT_FALSE(decoder.TakeVolume().has_value()) << "nothing has arrived";
  ASSERT_TRUE(decoder.OnBytes(0, writer.Pixels(0, Light(10), false), 0).ok());
  EXPECT_FALSE(decoder.TakeVolume().has_value()) << "half of it has arrived";
  ASSERT_TRUE(decoder.OnBytes(0, writer.Pixels(1, Light(20), true), 0).ok());
  const auto volume = decoder.TakeVolume();
  ASSERT_TRUE(volume.has_value());
  EXPECT_THAT(volume->Rgb(), ElementsAre(11, 12, 10, 14, 15, 13, 21, 22, 20, 24, 25, 23));
  EXPECT_EQ(volume->source, DecodedVolume::Source::kDecodedFromSent);
  EXPECT_FALSE(decoder.TakeVolume().has_value()) << "it has been taken";
  // Packets for synchronisation or for the end change nothing.
  if (const Bytes sync = writer.Sync(); !sync.empty()) {
    EXPECT_TRUE(decoder.OnBytes(0, sync, 0).ok());
  }
  if (const Bytes end = writer.End(0, Light(90)); !end.empty()) {
    EXPECT_TRUE(decoder.OnBytes(0, end, 0).ok());
  }
  EXPECT_FALSE(decoder.TakeVolume().has_value());
  // One slice is sent again: the other is unchanged.
  ASSERT_TRUE(decoder.OnBytes(0, writer.Pixels(1, Light(30), true), 0).ok());
  EXPECT_THAT(decoder.TakeVolume()->Rgb(),
              ElementsAre(11, 12, 10, 14, 15, 13, 31, 32, 30, 34, 35, 33));
  // From the first foreign packet on, it returns nothing.
  ASSERT_TRUE(decoder.OnBytes(0, writer.Pixels(1, Light(40), true), 0).ok());
  const absl::Status wrong = decoder.OnBytes(0, Bytes(3), 0);
  EXPECT_TRUE(absl::IsDataLoss(wrong));
  EXPECT_THAT(std::string(wrong.message()),
              HasSubstr("a packet of 3 bytes is none of this stream"));
  EXPECT_EQ(decoder.OnBytes(0, writer.Pixels(1, Light(50), true), 0), wrong);
  EXPECT_FALSE(decoder.TakeVolume().has_value());
}

INSTANTIATE_TEST_SUITE_P(Protocols, Decoders,
                         testing::Values(Protocol::kDdp, Protocol::kE131, Protocol::kArtNet,
                                         Protocol::kOpc));

// Changes one field of a good packet at a time; each change is refused.
TEST(Packets, OfDdpEachFieldCounts) {
  const StreamOptions stream = StreamOf(Protocol::kDdp);
  const Bytes good = PacketWriter(stream, 2).Pixels(1, Light(1), true);
  ASSERT_TRUE(Read(stream, 2, 2, good).has_value());
  EXPECT_TRUE(Read(stream, 2, 2, good)->last);
  EXPECT_EQ(Read(stream, 2, 2, good)->sequence, 1);
  EXPECT_FALSE(Read(stream, 2, 2, PacketWriter(stream, 2).Pixels(1, Light(1), false))->last);
  EXPECT_FALSE(Read(stream, 2, 3, good).has_value()) << "of fewer pixels";
  EXPECT_FALSE(Read(stream, 1, 2, good).has_value()) << "of the slice after the last";
  for (const size_t at : {size_t{0}, size_t{2}, size_t{9}}) {
    Bytes bad = good;
    bad[at] ^= std::byte{0x10};
    EXPECT_FALSE(Read(stream, 2, 2, bad).has_value()) << at;
  }
  Bytes between = good;
  between[7] = std::byte{3};  // a pixel later
  EXPECT_FALSE(Read(stream, 2, 2, between).has_value());
}

TEST(Packets, OfE131EachFieldCounts) {
  const StreamOptions stream = StreamOf(Protocol::kE131, 7);
  PacketWriter writer(stream, 2);
  const Bytes good = writer.Pixels(1, Light(1), true);
  ASSERT_TRUE(Read(stream, 2, 2, good).has_value());
  EXPECT_FALSE(Read(stream, 1, 2, good).has_value()) << "of the slice after the last";
  StreamOptions later = stream;
  later.first_universe = 7;
  EXPECT_FALSE(Read(later, 2, 2, good).has_value()) << "of a universe before the first";
  EXPECT_FALSE(Read(stream, 2, 3, good).has_value()) << "of fewer pixels";
  // Preamble, lengths of three layers, their vectors, the type of addresses, the count, the start code.
  for (const size_t at : {0u, 1u, 5u, 17u, 21u, 39u, 43u, 116u, 117u, 118u, 124u, 125u}) {
    Bytes bad = good;
    bad[at] ^= std::byte{0x01};
    EXPECT_FALSE(Read(stream, 2, 2, bad).has_value()) << at;
  }
  const Bytes sync = writer.Sync();
  const auto read = Read(stream, 2, 2, sync);
  ASSERT_TRUE(read.has_value());
  EXPECT_EQ(read->kind, ReadPacket::Kind::kSync);
  EXPECT_FALSE(Read(StreamOf(Protocol::kE131, 8), 2, 2, sync).has_value())
      << "of another synchronisation";
  Bytes longer = sync;
  longer.push_back({});
  Put16(longer, 16, 0x7000 | (longer.size() - 16));
  Put16(longer, 38, 0x7000 | (longer.size() - 38));
  EXPECT_FALSE(Read(stream, 2, 2, longer).has_value());
  Bytes discovery = sync;
  discovery[43] = std::byte{2};  // the extended layer is of another kind
  EXPECT_FALSE(Read(stream, 2, 2, discovery).has_value());
  EXPECT_EQ(Read(stream, 2, 2, writer.End(0, Light(1)))->kind, ReadPacket::Kind::kEnd);
}

TEST(Packets, OfArtNetEachFieldCounts) {
  const StreamOptions stream = StreamOf(Protocol::kArtNet, 1);
  PacketWriter writer(stream, 2);
  const Bytes good = writer.Pixels(1, Light(1), true);
  ASSERT_TRUE(Read(stream, 2, 2, good).has_value());
  EXPECT_FALSE(Read(stream, 1, 2, good).has_value());
  StreamOptions later = stream;
  later.first_universe = 7;
  EXPECT_FALSE(Read(later, 2, 2, good).has_value());
  for (const size_t at : {0u, 8u, 9u, 10u, 11u, 17u}) {
    Bytes bad = good;
    bad[at] ^= std::byte{0x01};
    EXPECT_FALSE(Read(stream, 2, 2, bad).has_value()) << at;
  }
  EXPECT_EQ(Read(stream, 2, 2, writer.Sync())->kind, ReadPacket::Kind::kSync);
}

TEST(Packets, OfOpcEachFieldCounts) {
  const StreamOptions stream = StreamOf(Protocol::kOpc, 1);
  PacketWriter writer(stream, 2);
  const Bytes good = writer.Pixels(1, Light(1), true);
  ASSERT_TRUE(Read(stream, 2, 2, good).has_value());
  EXPECT_FALSE(Read(stream, 1, 2, good).has_value());
  for (const size_t at : {1u, 2u, 3u}) {
    Bytes bad = good;
    bad[at] ^= std::byte{0x01};
    EXPECT_FALSE(Read(stream, 2, 2, bad).has_value()) << at;
  }
  Bytes before = good;
  before[0] = std::byte{4};
  EXPECT_FALSE(Read(stream, 2, 2, before).has_value()) << "of the channel before the first";
  EXPECT_TRUE(writer.Sync().empty()) << "the protocol has no such packet";
  EXPECT_TRUE(PacketWriter(StreamOf(Protocol::kDdp, 1), 2).Sync().empty());
}

TEST(Packets, AStreamHasSoManySlicesAndPixels) {
  const auto slices = [](Protocol protocol, int32_t first) {
    return MostSlices({.protocol = protocol, .first_universe = first});
  };
  EXPECT_EQ(slices(Protocol::kDdp, 1), 512);
  EXPECT_EQ(slices(Protocol::kE131, 1), 512);
  EXPECT_EQ(slices(Protocol::kE131, 63999), 1);
  EXPECT_EQ(slices(Protocol::kArtNet, 0), 512);
  EXPECT_EQ(slices(Protocol::kArtNet, 32767), 1);
  EXPECT_EQ(slices(Protocol::kOpc, 1), 8);
  EXPECT_EQ(slices(Protocol::kOpc, 255), 1);
  EXPECT_EQ(MostPixels(Protocol::kDdp), 480);
  EXPECT_EQ(MostPixels(Protocol::kE131), 170);
  EXPECT_EQ(MostPixels(Protocol::kArtNet), 170);
  EXPECT_EQ(MostPixels(Protocol::kOpc), 16384);
}

}  // namespace
}  // namespace voxeld::display::network
