#include "tools/lights/datagram.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <random>
#include <string_view>
#include <tuple>
#include <vector>

#include "absl/strings/str_cat.h"

namespace voxeld::lights {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using Bytes = std::vector<uint8_t>;

// Written out from the protocols' tables, independently of this project's own writer.
Bytes Ddp(uint8_t flags, uint8_t sequence, uint8_t type, uint32_t offset, const Bytes& data) {
  Bytes out = {flags, sequence, type, 1};
  for (int shift = 24; shift >= 0; shift -= 8) out.push_back(static_cast<uint8_t>(offset >> shift));
  out.push_back(static_cast<uint8_t>(data.size() >> 8));
  out.push_back(static_cast<uint8_t>(data.size()));
  out.insert(out.end(), data.begin(), data.end());
  return out;
}

// ANSI E1.31-2018, table 4-1.
Bytes E131(uint16_t universe, uint8_t sequence, const Bytes& data, uint8_t priority = 100,
           uint8_t options = 0, uint16_t sync = 0) {
  Bytes out(126, 0);
  const auto put16 = [&out](size_t at, size_t value) {
    out[at] = static_cast<uint8_t>(value >> 8);
    out[at + 1] = static_cast<uint8_t>(value);
  };
  const size_t whole = 126 + data.size();
  put16(0, 0x0010);
  std::memcpy(out.data() + 4, "ASC-E1.17", 9);
  put16(16, 0x7000 | (whole - 16));
  out[21] = 4;
  out[22] = 0xC1;  // CID
  put16(38, 0x7000 | (whole - 38));
  out[43] = 2;
  std::memcpy(out.data() + 44, "a desk", 6);
  out[108] = priority;
  put16(109, sync);
  out[111] = sequence;
  out[112] = options;
  put16(113, universe);
  put16(115, 0x7000 | (whole - 115));
  out[117] = 2;
  out[118] = 0xA1;
  put16(121, 1);
  put16(123, data.size() + 1);
  out.insert(out.end(), data.begin(), data.end());
  return out;
}

Bytes E131Sync(uint16_t universe, uint8_t sequence) {
  Bytes out(49, 0);
  out[1] = 0x10;
  std::memcpy(out.data() + 4, "ASC-E1.17", 9);
  out[16] = 0x70;
  out[17] = 49 - 16;
  out[21] = 8;
  out[38] = 0x70;
  out[39] = 49 - 38;
  out[43] = 1;
  out[44] = sequence;
  out[45] = static_cast<uint8_t>(universe >> 8);
  out[46] = static_cast<uint8_t>(universe);
  return out;
}

Bytes ArtDmx(uint16_t universe, uint8_t sequence, const Bytes& data) {
  Bytes out = {'A', 'r', 't', '-', 'N', 'e', 't', 0, 0x00, 0x50, 0, 14, sequence, 0};
  out.push_back(static_cast<uint8_t>(universe));
  out.push_back(static_cast<uint8_t>(universe >> 8));
  out.push_back(static_cast<uint8_t>(data.size() >> 8));
  out.push_back(static_cast<uint8_t>(data.size()));
  out.insert(out.end(), data.begin(), data.end());
  return out;
}

std::string Wrong(Protocol protocol, const Bytes& packet) {
  return std::string(ReadDatagram(protocol, packet).status().message());
}

TEST(DdpDatagram, SaysWhatItHas) {
  const Bytes packet = Ddp(0x41, 0x27, 0x0B, 0x01020304, {9, 8, 7});
  const auto read = ReadDatagram(Protocol::kDdp, packet);
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(read->kind, Datagram::Kind::kLights);
  EXPECT_TRUE(read->push);
  EXPECT_EQ(read->sequence, 7);  // the low four bits
  EXPECT_EQ(read->first_byte, 0x01020304u);
  EXPECT_THAT(read->values, ElementsAre(9, 8, 7));
}

TEST(DdpDatagram, MayHaveATimecode) {
  Bytes packet = Ddp(0x50, 0, 0x0B, 0, {1, 2, 3});
  packet.insert(packet.begin() + 10, {0xAA, 0xBB, 0xCC, 0xDD});
  const auto read = ReadDatagram(Protocol::kDdp, packet);
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_FALSE(read->push);
  EXPECT_FALSE(read->sequence.has_value());
  EXPECT_THAT(read->values, ElementsAre(1, 2, 3));
}

TEST(DdpDatagram, OfNoLightsIsToldApart) {
  EXPECT_EQ(ReadDatagram(Protocol::kDdp, Ddp(0x41, 0, 0x0B, 0, {}))->kind, Datagram::Kind::kShow);
  EXPECT_EQ(ReadDatagram(Protocol::kDdp, Ddp(0x42, 0, 0, 0, {}))->kind, Datagram::Kind::kOther);
  Bytes status = Ddp(0x40, 0, 0x0B, 0, {1, 2, 3});
  status[3] = 251;
  EXPECT_EQ(ReadDatagram(Protocol::kDdp, status)->kind, Datagram::Kind::kOther);
}

TEST(DdpDatagram, SaysWhatIsWrong) {
  EXPECT_THAT(Wrong(Protocol::kDdp, {0x41, 0, 0}), HasSubstr("a packet of 3 bytes; it takes 10"));
  EXPECT_THAT(Wrong(Protocol::kDdp, Ddp(0x81, 0, 0x0B, 0, {1, 2, 3})), HasSubstr("version 2"));
  Bytes cut = Ddp(0x41, 0, 0x0B, 0, {1, 2, 3});
  cut.pop_back();
  EXPECT_THAT(Wrong(Protocol::kDdp, cut), HasSubstr("say 3 bytes of data; 2 are there"));
  EXPECT_THAT(Wrong(Protocol::kDdp, Ddp(0x41, 0, 0x1B, 0, {1, 2, 3, 4})),
              HasSubstr("byte 2 is 27"));
}

TEST(DdpDatagram, OfNothingIsAWordToShowOrNone) {
  EXPECT_EQ(ReadDatagram(Protocol::kDdp, Ddp(0x41, 0, 0x0B, 0, {}))->kind, Datagram::Kind::kShow);
  EXPECT_EQ(ReadDatagram(Protocol::kDdp, Ddp(0x40, 0, 0x0B, 0, {}))->kind, Datagram::Kind::kOther);
}

// Each field of the layers is changed in turn: the packet is refused, and the message names the
// field.
TEST(E131Datagram, EachFieldOfItsLayersCounts) {
  const Bytes good = E131(3, 9, {1, 2, 3});
  for (const size_t at :
       {16u, 17u, 38u, 39u, 115u, 116u, 117u, 118u, 119u, 120u, 121u, 122u, 123u, 124u}) {
    Bytes bad = good;
    bad[at] ^= 0x01;
    EXPECT_TRUE(absl::IsInvalidArgument(ReadDatagram(Protocol::kE131, bad).status())) << at;
  }
  // Its lengths are right, but it ends before its values.
  for (const size_t size : {49u, 125u}) {
    Bytes cut(good.begin(), good.begin() + static_cast<std::ptrdiff_t>(size));
    for (const size_t at : {16u, 38u}) {
      cut[at] = static_cast<uint8_t>(0x70 | (size - at) >> 8);
      cut[at + 1] = static_cast<uint8_t>(size - at);
    }
    EXPECT_EQ(Wrong(Protocol::kE131, cut),
              absl::StrCat("a packet of ", size, " bytes; it takes 126 at least"));
  }
  EXPECT_THAT(Wrong(Protocol::kE131, E131(3, 9, Bytes(513))), HasSubstr("512 are the most"));
  EXPECT_EQ(ReadDatagram(Protocol::kE131, E131(3, 9, Bytes(512)))->values.size(), 512u);
  EXPECT_EQ(Wrong(Protocol::kE131, E131(0, 9, {1})), "universe 0; 1 to 63999 are possible");
  EXPECT_EQ(Wrong(Protocol::kE131, E131(64000, 9, {1})), "universe 64000; 1 to 63999 are possible");
  EXPECT_TRUE(ReadDatagram(Protocol::kE131, E131(63999, 9, {1}, 200)).ok());
  EXPECT_EQ(Wrong(Protocol::kE131, E131(1, 9, {1}, 201)), "priority 201; 200 is the most");
}

// Art-Net 4's table of ArtPollReply, field by field: 239 bytes; all that are not named here are 0.
TEST(ArtNetDatagram, AnAnswerIsAsItsTableHasIt) {
  for (const auto& [first, universes, ports] : {std::tuple{0x1234, 3, 3}, std::tuple{0x123E, 9, 2},
                                                std::tuple{0, 9, 4}, std::tuple{0, 0, 1}}) {
    Bytes want(239);
    const auto put = [&want](size_t at, std::string_view text) {
      std::copy(text.begin(), text.end(), want.begin() + static_cast<std::ptrdiff_t>(at));
    };
    put(0, std::string_view("Art-Net\0\0\x21", 10));
    want[10] = 10, want[13] = 7;
    want[14] = 0x36, want[15] = 0x19;                   // port 6454, low byte first
    want[18] = static_cast<uint8_t>(first >> 8);        // NetSwitch
    want[19] = static_cast<uint8_t>(first >> 4 & 0xF);  // SubSwitch
    want[23] = 0xD0;                                    // Status1
    put(26, "voxeld");
    put(44, "voxeld: lights of a volumetric display");
    put(108, "#0001 [0000] ready");
    want[173] = static_cast<uint8_t>(ports);
    for (int i = 0; i < ports; ++i) {
      want[static_cast<size_t>(174 + i)] = 0x80;
      want[static_cast<size_t>(182 + i)] = 0x80;
      want[static_cast<size_t>(190 + i)] = static_cast<uint8_t>((first & 0xF) + i);
    }
    want[212] = 0x08;
    EXPECT_THAT(ArtPollReply({10, 0, 0, 7}, 6454, first, universes),
                ::testing::ElementsAreArray(want))
        << first;
  }
}

TEST(ArtNetDatagram, EachLengthIsLookedAt) {
  const Bytes good = ArtDmx(5, 0, {1, 2});
  ASSERT_TRUE(ReadDatagram(Protocol::kArtNet, good).ok());
  for (size_t size = 0; size < good.size(); ++size) {
    const Bytes cut(good.begin(), good.begin() + static_cast<std::ptrdiff_t>(size));
    EXPECT_FALSE(ReadDatagram(Protocol::kArtNet, cut).ok()) << size;
  }
  EXPECT_EQ(Wrong(Protocol::kArtNet, Bytes(9)), "a packet of 9 bytes; it takes 10 at least");
  EXPECT_EQ(Wrong(Protocol::kArtNet, Bytes(good.begin(), good.begin() + 11)),
            "a packet of 11 bytes; it takes 12 at least");
  EXPECT_EQ(Wrong(Protocol::kArtNet, Bytes(good.begin(), good.begin() + 17)),
            "a packet of 17 bytes; it takes 18 at least");
  EXPECT_EQ(Wrong(Protocol::kArtNet, ArtDmx(5, 0, {1})),
            "bytes 16 and 17 say 1 values; 2 to 512 are possible");
  EXPECT_EQ(Wrong(Protocol::kArtNet, ArtDmx(5, 0, Bytes(513))),
            "bytes 16 and 17 say 513 values; 2 to 512 are possible");
  EXPECT_EQ(ReadDatagram(Protocol::kArtNet, ArtDmx(5, 0, Bytes(512)))->values.size(), 512u);
  // A packet for others may be as short as its opcode.
  Bytes other(good.begin(), good.begin() + 10);
  other[9] = 0x60;
  EXPECT_EQ(ReadDatagram(Protocol::kArtNet, other)->kind, Datagram::Kind::kOther);
}

TEST(DdpDatagram, WhatIsForOthersIsPassedOver) {
  for (const uint8_t flag : {0x02, 0x04, 0x08}) {
    EXPECT_EQ(ReadDatagram(Protocol::kDdp, Ddp(0x40 | flag, 0, 0x0B, 0, {1, 2, 3}))->kind,
              Datagram::Kind::kOther);
  }
  Bytes other = Ddp(0x40, 0, 0x0B, 0, {1, 2, 3});
  other[3] = 2;  // another output
  EXPECT_EQ(ReadDatagram(Protocol::kDdp, other)->kind, Datagram::Kind::kOther);
  other[3] = 255;
  EXPECT_EQ(ReadDatagram(Protocol::kDdp, other)->kind, Datagram::Kind::kLights) << "for all";
  EXPECT_EQ(Wrong(Protocol::kDdp, Bytes(9)), "a packet of 9 bytes; it takes 10 at least");
  EXPECT_TRUE(ReadDatagram(Protocol::kDdp, Ddp(0x40, 0, 0, 0, {1, 2, 3})).ok());
  EXPECT_TRUE(ReadDatagram(Protocol::kDdp, Ddp(0x40, 0, 1, 0, {1, 2, 3})).ok());
  EXPECT_EQ(Wrong(Protocol::kDdp, Ddp(0x40, 0, 2, 0, {1, 2, 3})),
            "byte 2 is 2; RGB of 8 bits is 11");
}

TEST(E131Datagram, ASyncPacketSaysItsNumberAndUniverse) {
  const auto sync = ReadDatagram(Protocol::kE131, E131Sync(0x1234, 77));
  ASSERT_TRUE(sync.ok()) << sync.status();
  EXPECT_EQ(sync->kind, Datagram::Kind::kShow);
  EXPECT_EQ(sync->sequence, 77);
  EXPECT_EQ(sync->universe, 0x1234);
  Bytes discovery = E131Sync(0x1234, 77);
  discovery[43] = 2;
  EXPECT_EQ(ReadDatagram(Protocol::kE131, discovery)->kind, Datagram::Kind::kOther);
}

TEST(Datagrams, OpcHasNone) {
  EXPECT_EQ(Wrong(Protocol::kOpc, {0, 0, 0, 0}),
            "Open Pixel Control comes as a stream, not in packets");
}

TEST(E131Datagram, SaysWhatItHas) {
  const Bytes packet = E131(513, 250, {1, 2, 3, 4}, 150, 0, 77);
  const auto read = ReadDatagram(Protocol::kE131, packet);
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(read->kind, Datagram::Kind::kLights);
  EXPECT_EQ(read->universe, 513);
  EXPECT_EQ(read->sequence, 250);
  EXPECT_EQ(read->priority, 150);
  EXPECT_EQ(read->sync_universe, 77);
  EXPECT_EQ(read->source[0], 0xC1);
  EXPECT_THAT(read->values, ElementsAre(1, 2, 3, 4));
}

TEST(E131Datagram, OfNoLightsIsToldApart) {
  const auto sync = ReadDatagram(Protocol::kE131, E131Sync(0x1234, 5));
  ASSERT_TRUE(sync.ok()) << sync.status();
  EXPECT_EQ(sync->kind, Datagram::Kind::kShow);
  EXPECT_EQ(sync->universe, 0x1234);
  EXPECT_EQ(ReadDatagram(Protocol::kE131, E131(1, 0, {1}, 100, 0x40))->kind, Datagram::Kind::kEnd);
  EXPECT_EQ(ReadDatagram(Protocol::kE131, E131(1, 0, {1}, 100, 0x80))->kind,
            Datagram::Kind::kOther);  // a preview
  Bytes text = E131(1, 0, {1, 2});
  text[125] = 0x17;  // another start code
  EXPECT_EQ(ReadDatagram(Protocol::kE131, text)->kind, Datagram::Kind::kOther);
}

TEST(E131Datagram, SaysWhatIsWrong) {
  EXPECT_THAT(Wrong(Protocol::kE131, Bytes(48)), HasSubstr("it takes 49"));
  EXPECT_THAT(Wrong(Protocol::kE131, Bytes(200)), HasSubstr("as ACN does"));
  Bytes longer = E131(1, 0, {1, 2, 3});
  longer.push_back(4);
  EXPECT_THAT(Wrong(Protocol::kE131, longer), HasSubstr("bytes 16 and 17"));
  EXPECT_THAT(Wrong(Protocol::kE131, E131(0, 0, {1})), HasSubstr("universe 0; 1 to 63999"));
  EXPECT_THAT(Wrong(Protocol::kE131, E131(1, 0, {1}, 201)), HasSubstr("priority 201; 200"));
  EXPECT_THAT(Wrong(Protocol::kE131, E131(1, 0, Bytes(513))), HasSubstr("512 are the most"));
}

TEST(ArtNetDatagram, SaysWhatItHas) {
  const Bytes packet = ArtDmx(0x7FFE, 3, {1, 2, 3, 4});
  const auto read = ReadDatagram(Protocol::kArtNet, packet);
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(read->universe, 0x7FFE);
  EXPECT_EQ(read->sequence, 3);
  EXPECT_THAT(read->values, ElementsAre(1, 2, 3, 4));
  EXPECT_FALSE(ReadDatagram(Protocol::kArtNet, ArtDmx(0, 0, {1, 2}))->sequence.has_value());
}

TEST(ArtNetDatagram, OfNoLightsIsToldApart) {
  Bytes sync = {'A', 'r', 't', '-', 'N', 'e', 't', 0, 0x00, 0x52, 0, 14, 0, 0};
  EXPECT_EQ(ReadDatagram(Protocol::kArtNet, sync)->kind, Datagram::Kind::kShow);
  sync[9] = 0x20;
  EXPECT_EQ(ReadDatagram(Protocol::kArtNet, sync)->kind, Datagram::Kind::kAsk);
  sync[9] = 0x60;  // an address
  EXPECT_EQ(ReadDatagram(Protocol::kArtNet, sync)->kind, Datagram::Kind::kOther);
}

TEST(ArtNetDatagram, SaysWhatIsWrong) {
  EXPECT_THAT(Wrong(Protocol::kArtNet, {'A', 'r', 't'}), HasSubstr("a packet of 3 bytes"));
  EXPECT_THAT(Wrong(Protocol::kArtNet, Bytes(20)), HasSubstr("Art-Net"));
  Bytes old = ArtDmx(0, 0, {1, 2});
  old[11] = 13;
  EXPECT_THAT(Wrong(Protocol::kArtNet, old), HasSubstr("revision 13"));
  Bytes cut = ArtDmx(0, 0, {1, 2, 3, 4});
  cut.pop_back();
  EXPECT_THAT(Wrong(Protocol::kArtNet, cut), HasSubstr("say 4 values; 3 are there"));
  EXPECT_THAT(Wrong(Protocol::kArtNet, ArtDmx(0, 0, Bytes(514))), HasSubstr("514 values"));
}

// Offsets of Art-Net 4, ArtPollReply.
TEST(ArtNetDatagram, AnAnswerSaysWhoIsThere) {
  const auto reply = ArtPollReply({192, 168, 1, 20}, 6454, 0x0123, 3);
  EXPECT_EQ(std::string_view(reinterpret_cast<const char*>(reply.data())), "Art-Net");
  EXPECT_EQ(reply[8] | reply[9] << 8, 0x2100);
  EXPECT_THAT(std::span(reply).subspan(10, 4), ElementsAre(192, 168, 1, 20));
  EXPECT_EQ(reply[14] | reply[15] << 8, 6454);
  EXPECT_EQ(reply[18], 0x01);  // net, sub-net, and each port's universe
  EXPECT_EQ(reply[19], 0x02);
  EXPECT_EQ(reply[173], 3);
  EXPECT_THAT(std::span(reply).subspan(190, 4), ElementsAre(3, 4, 5, 0));
  EXPECT_THAT(std::span(reply).subspan(174, 4), ElementsAre(0x80, 0x80, 0x80, 0));
}

TEST(Datagrams, NoBytesDoHarm) {
  std::mt19937 random(5);
  for (int i = 0; i < 200'000; ++i) {
    Bytes packet = i % 3 == 0   ? Ddp(0x41, 1, 0x0B, 0, Bytes(random() % 40))
                   : i % 3 == 1 ? E131(1, 1, Bytes(random() % 40))
                                : ArtDmx(1, 1, Bytes(2 + random() % 40));
    for (unsigned n = random() % 4; n > 0; --n) {
      packet[random() % packet.size()] = static_cast<uint8_t>(random());
    }
    packet.resize(random() % 8 == 0 ? random() % packet.size() : packet.size());
    for (const Protocol protocol : {Protocol::kDdp, Protocol::kE131, Protocol::kArtNet}) {
      const auto read = ReadDatagram(protocol, packet);
      if (!read.ok()) {
        EXPECT_FALSE(read.status().message().empty());
        continue;
      }
      EXPECT_LE(read->values.size(), packet.size());
      if (!read->values.empty()) {
        EXPECT_GE(read->values.data(), packet.data());
        EXPECT_LE(read->values.data() + read->values.size(), packet.data() + packet.size());
      }
    }
  }
}

}  // namespace
}  // namespace voxeld::lights
