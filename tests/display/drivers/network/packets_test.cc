#include "display/drivers/network/packets.h"

#include <algorithm>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace voxeld::display::network {
namespace {

using ::testing::ElementsAre;
using ::testing::ElementsAreArray;

std::vector<int> Ints(std::span<const std::byte> bytes) {
  std::vector<int> out;
  for (const std::byte b : bytes) out.push_back(std::to_integer<int>(b));
  return out;
}

StreamOptions Stream(Protocol protocol, int32_t first = 1, int32_t sync = 0) {
  StreamOptions stream{.protocol = protocol, .first_universe = first, .sync_universe = sync};
  for (size_t i = 0; i < 16; ++i) stream.cid[i] = static_cast<uint8_t>(0xA0 + i);
  return stream;
}

// The header according to the specification: version 1 and push, sequence, RGB of 8 bits, the
// default output, offset, length.
TEST(Ddp, IsAsItsSpecificationHasIt) {
  PacketWriter writer(Stream(Protocol::kDdp), 2);
  const std::vector<uint8_t> rgb = {1, 2, 3, 4, 5, 6};
  EXPECT_THAT(Ints(writer.Pixels(0, rgb, false)),
              ElementsAre(0x40, 1, 0x0B, 1, 0, 0, 0, 0, 0, 6, 1, 2, 3, 4, 5, 6));
  EXPECT_THAT(Ints(writer.Pixels(100, rgb, true)),
              ElementsAre(0x41, 2, 0x0B, 1, 0, 0, 0x02, 0x58, 0, 6, 1, 2, 3, 4, 5, 6));
  // 1 to 15; 0 would mean that packets are not counted.
  for (int i = 3; i <= 40; ++i) {
    EXPECT_EQ(Ints(writer.Pixels(0, rgb, true))[1], (i - 1) % 15 + 1);
  }
  EXPECT_TRUE(writer.Sync().empty());
  EXPECT_TRUE(writer.End(0, rgb).empty());
}

// Table 4-1 of E1.31, a universe of two pixels.
TEST(E131, IsAsItsStandardHasIt) {
  StreamOptions stream = Stream(Protocol::kE131, 0x1234, 7);
  stream.priority = 99;
  PacketWriter writer(stream, 2);
  const std::vector<uint8_t> rgb = {1, 2, 3, 4, 5, 6};
  writer.Pixels(2, rgb, false);
  const std::vector<int> packet = Ints(writer.Pixels(2, rgb, true));
  ASSERT_EQ(packet.size(), 132u);
  std::vector<int> want = {0,   0x10, 0, 0, 'A', 'S',  'C', '-', 'E', '1', '.',
                           '1', '7',  0, 0, 0,   0x70, 116, 0,   0,   0,   4};
  for (int i = 0; i < 16; ++i) want.push_back(0xA0 + i);
  for (const int b : {0x70, 94, 0, 0, 0, 2}) want.push_back(b);
  const std::string name = "voxeld";
  for (size_t i = 0; i < 64; ++i) want.push_back(i < name.size() ? name[i] : 0);
  for (const int b :
       {99, 0, 7, 1, 0, 0x12, 0x36, 0x70, 17, 2, 0xA1, 0, 0, 0, 1, 0, 7, 0, 1, 2, 3, 4, 5, 6}) {
    want.push_back(b);
  }
  EXPECT_THAT(packet, ElementsAreArray(want));
  EXPECT_EQ(Ints(writer.End(2, rgb))[112], 0x40);
  // 6.3: a synchronisation packet of 49 bytes.
  const std::vector<int> sync = Ints(writer.Sync());
  ASSERT_EQ(sync.size(), 49u);
  EXPECT_THAT(std::vector<int>(sync.begin() + 16, sync.begin() + 22),
              ElementsAre(0x70, 33, 0, 0, 0, 8));
  EXPECT_THAT(std::vector<int>(sync.begin() + 38, sync.end()),
              ElementsAre(0x70, 11, 0, 0, 0, 1, 0, 0, 7, 0, 0));
}

// 6.7.2: a receiver ignores numbers up to 20 behind the last one. Whatever that is, either a packet
// before a leap or the one after it is accepted.
TEST(E131, OneOfTwoIsTakenWhateverTheReceiverRemembers) {
  PacketWriter writer(Stream(Protocol::kE131, 1), 1);
  const std::vector<uint8_t> rgb = {1, 2, 3};
  const auto sequence = [&] { return Ints(writer.Pixels(0, rgb, true))[111]; };
  for (int i = 0; i < 300; ++i) {
    const int before = sequence();
    ASSERT_TRUE(writer.Leap());
    const int after = sequence();
    for (int last = 0; last < 256; ++last) {
      const auto taken = [last](int number) {
        const auto ahead = static_cast<int8_t>(number - last);
        return !(ahead <= 0 && ahead > -20);
      };
      EXPECT_TRUE(taken(before) || taken(after)) << before << ", " << after << " after " << last;
    }
  }
  EXPECT_FALSE(PacketWriter(Stream(Protocol::kDdp, 0), 1).Leap());
}

TEST(ArtNet, IsAsItsSpecificationHasIt) {
  PacketWriter writer(Stream(Protocol::kArtNet, 0x01FE, 1), 1);
  const std::vector<uint8_t> rgb = {9, 8, 7};
  EXPECT_THAT(Ints(writer.Pixels(1, rgb, true)),
              ElementsAre('A', 'r', 't', '-', 'N', 'e', 't', 0, 0x00, 0x50, 0, 14, 1, 0, 0xFF, 0x01,
                          0, 4, 9, 8, 7, 0));
  EXPECT_THAT(Ints(writer.Sync()),
              ElementsAre('A', 'r', 't', '-', 'N', 'e', 't', 0, 0x00, 0x52, 0, 14, 0, 0));
  for (int i = 2; i <= 300; ++i)
    EXPECT_EQ(Ints(writer.Pixels(1, rgb, true))[12], (i - 1) % 255 + 1);
}

TEST(Opc, IsAsItsSpecificationHasIt) {
  PacketWriter writer(Stream(Protocol::kOpc, 3), 2);
  EXPECT_THAT(Ints(writer.Pixels(1, std::vector<uint8_t>{1, 2, 3, 4, 5, 6}, true)),
              ElementsAre(4, 0, 0, 6, 1, 2, 3, 4, 5, 6));
}

class EveryProtocol : public testing::TestWithParam<Protocol> {};

TEST_P(EveryProtocol, ReadsWhatItWrites) {
  std::mt19937 random(1);
  const StreamOptions stream = Stream(GetParam(), 5, GetParam() == Protocol::kE131 ? 9 : 0);
  for (const int32_t pixels : {1, 2, 7, 170}) {
    PacketWriter writer(stream, pixels);
    for (int32_t slice = 0; slice < 8; ++slice) {
      std::vector<uint8_t> rgb(static_cast<size_t>(pixels) * 3);
      for (uint8_t& b : rgb) b = static_cast<uint8_t>(random());
      const std::vector<std::byte> packet = writer.Pixels(slice, rgb, slice == 7);
      const auto read = Read(stream, 8, pixels, packet);
      ASSERT_TRUE(read.has_value());
      EXPECT_EQ(read->kind, ReadPacket::Kind::kPixels);
      EXPECT_EQ(read->slice, slice);
      EXPECT_TRUE(
          std::equal(rgb.begin(), rgb.end(), read->rgb.begin(), read->rgb.end(),
                     [](uint8_t a, std::byte b) { return a == std::to_integer<uint8_t>(b); }));
      EXPECT_FALSE(Read(stream, slice, pixels, packet).has_value()) << "of a slice too many";
    }
  }
}

// Truncated, extended, or with any byte changed: it is never read beyond the end, and never gives a
// slice that does not exist.
TEST_P(EveryProtocol, WhatIsBrokenIsRefusedOrOfAnotherContent) {
  std::mt19937 random(2);
  const StreamOptions stream = Stream(GetParam(), 1, 1);
  PacketWriter writer(stream, 3);
  const std::vector<std::byte> packet = writer.Pixels(1, std::vector<uint8_t>(9, 200), true);
  for (size_t size = 0; size < packet.size(); ++size) {
    // In a separate memory block, so that a read past the last byte is detected.
    const std::vector<std::byte> cut(packet.begin(), packet.begin() + static_cast<ptrdiff_t>(size));
    EXPECT_FALSE(Read(stream, 4, 3, cut).has_value()) << size;
  }
  std::vector<std::byte> longer = packet;
  longer.push_back(std::byte{0});
  EXPECT_FALSE(Read(stream, 4, 3, longer).has_value());
  for (int i = 0; i < 20000; ++i) {
    std::vector<std::byte> changed = packet;
    for (int n = 0; n < 1 + i % 3; ++n) changed[random() % changed.size()] = std::byte(random());
    const auto read = Read(stream, 4, 3, changed);
    if (!read || read->kind == ReadPacket::Kind::kSync) continue;
    EXPECT_GE(read->slice, 0);
    EXPECT_LT(read->slice, 4);
    EXPECT_EQ(read->rgb.size(), 9u);
  }
}

INSTANTIATE_TEST_SUITE_P(Protocols, EveryProtocol,
                         testing::Values(Protocol::kDdp, Protocol::kE131, Protocol::kArtNet,
                                         Protocol::kOpc));

}  // namespace
}  // namespace voxeld::display::network
