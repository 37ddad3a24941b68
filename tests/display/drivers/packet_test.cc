// Tests packets, checksums and capabilities of voxlink with bytes written by hand.

#include "display/drivers/voxlink/packet.h"

#include <algorithm>
#include <random>
#include <string>
#include <string_view>
#include <vector>

#include "display/crc/crc32c.h"
#include "gtest/gtest.h"

namespace voxeld::display::voxlink {
namespace {

using Bytes = std::vector<std::byte>;

Bytes Hex(std::string_view text) {
  Bytes out;
  std::string digits;
  for (const char c : text) {
    if (c != ' ' && c != '\n') digits.push_back(c);
  }
  for (size_t i = 0; i + 1 < digits.size(); i += 2) {
    out.push_back(static_cast<std::byte>(std::stoi(digits.substr(i, 2), nullptr, 16)));
  }
  return out;
}

Bytes Text(std::string_view text) {
  const auto bytes = std::as_bytes(std::span(text));
  return {bytes.begin(), bytes.end()};
}

// RFC 3720, appendix B.4.
TEST(Crc32c, KnownAnswers) {
  Bytes ascending(32), descending(32);
  for (int i = 0; i < 32; ++i) {
    ascending[static_cast<size_t>(i)] = static_cast<std::byte>(i);
    descending[static_cast<size_t>(31 - i)] = static_cast<std::byte>(i);
  }
  for (const auto crc : {&Crc32c, &Crc32cPortable}) {
    EXPECT_EQ(crc({}, 0), 0u);
    EXPECT_EQ(crc(Text("123456789"), 0), 0xE3069283u);
    EXPECT_EQ(crc(Bytes(32), 0), 0x8A9136AAu);
    EXPECT_EQ(crc(Bytes(32, std::byte{0xFF}), 0), 0x62A8AB43u);
    EXPECT_EQ(crc(ascending, 0), 0x46DD794Eu);
    EXPECT_EQ(crc(descending, 0), 0x113FDB5Cu);
  }
}

TEST(Crc32c, BothWaysAreEqualInAnyPieces) {
  std::mt19937 random(1);
  for (int round = 0; round < 200; ++round) {
    Bytes bytes(random() % (round % 2 == 0 ? 300 : 20000));
    for (std::byte& b : bytes) b = static_cast<std::byte>(random());
    const size_t cut = bytes.empty() ? 0 : random() % bytes.size();
    const std::span<const std::byte> all(bytes);
    const uint32_t whole = Crc32cPortable(all);
    EXPECT_EQ(Crc32c(all), whole);
    EXPECT_EQ(Crc32c(all.subspan(cut), Crc32c(all.first(cut))), whole);
  }
}

// The example of docs/protocols/voxlink.md §12.
TEST(Packets, AreTheBytesOfTheDocument) {
  PacketWriter writer;
  Bytes stream;
  writer.Begin(stream, 1, 0, 2, {});
  writer.Slice(stream, 1, 0, 0, 0, Hex("FF0000 00FF00"));
  writer.Slice(stream, 1, 1, 0, 0, Hex("0000FF FFFFFF"));
  writer.End(stream, 1, true);
  writer.Begin(stream, 2, 1, 2, Hex("02"));
  writer.Plain(stream, PacketType::kKeepalive, 0);
  EXPECT_EQ(stream, Hex("56584C4B 01 00 0000 0100000000000000 00000000 00000000 00000000 10000000"
                        "A46008D0 5827B64E 0000000000000000 02000000 00000000"
                        "56584C4B 02 00 0000 0100000000000000 01000000 00000000 00000000 06000000"
                        "35767245 D246CE6D FF0000 00FF00"
                        "56584C4B 02 00 0000 0100000000000000 02000000 01000000 00000000 06000000"
                        "B2C8B2E0 5686E9ED 0000FF FFFFFF"
                        "56584C4B 03 01 0000 0100000000000000 03000000 00000000 00000000 00000000"
                        "00000000 A942AF06"
                        "56584C4B 01 00 0000 0200000000000000 04000000 00000000 00000000 11000000"
                        "20D5A389 9623A735 0100000000000000 02000000 00000000 02"
                        "56584C4B 07 00 0000 0000000000000000 05000000 00000000 00000000 00000000"
                        "00000000 B2DB0E99"));
}

// Records what a parser found, as text.
struct Log final : PacketParser::Sink {
  void OnPacket(const PacketHeader& header, std::span<const std::byte> payload) override {
    lines.push_back(std::string(PacketTypeName(header.type)) + " " +
                    std::to_string(header.sequence) + " " + std::to_string(payload.size()));
  }
  void OnBadPayload(const PacketHeader& header) override {
    lines.push_back("bad " + std::to_string(header.sequence));
  }
  void OnSkipped(size_t bytes) override {
    skipped += bytes;
    lines.push_back("skipped");
  }
  std::vector<std::string> lines;
  size_t skipped = 0;
};

Bytes Stream() {
  PacketWriter writer;
  Bytes out;
  writer.Begin(out, 7, 3, 9, Hex("FF01"));
  writer.Slice(out, 7, 4, 1, 100, Bytes(50, std::byte{0x56}));
  writer.Show(out, 7, 12);
  writer.Plain(out, PacketType::kKeepalive, 0);
  writer.End(out, 7, false);
  return out;
}
const std::vector<std::string> kStreamLines = {"VOLUME_BEGIN 0 18", "SLICE 1 50", "SHOW 2 8",
                                               "KEEPALIVE 3 0", "VOLUME_END 4 0"};

TEST(PacketParser, FindsPacketsHoweverTheStreamIsCut) {
  const Bytes stream = Stream();
  for (size_t piece = 1; piece <= stream.size(); ++piece) {
    PacketParser parser(64);
    Log log;
    for (size_t at = 0; at < stream.size(); at += piece) {
      parser.Feed(std::span(stream).subspan(at, std::min(piece, stream.size() - at)), log);
    }
    EXPECT_EQ(log.lines, kStreamLines) << "pieces of " << piece;
    EXPECT_EQ(parser.pending(), 0u);
  }
}

TEST(PacketParser, FindsItsFeetAfterAnyDamagedByte) {
  const Bytes stream = Stream();
  for (size_t at = 0; at < stream.size(); ++at) {
    Bytes damaged = stream;
    damaged[at] ^= std::byte{0x40};
    for (const size_t piece : {damaged.size(), size_t{7}}) {
      PacketParser parser(64);
      Log log;
      for (size_t i = 0; i < damaged.size(); i += piece) {
        parser.Feed(std::span(damaged).subspan(i, std::min(piece, damaged.size() - i)), log);
      }
      size_t sound = 0;
      for (const std::string& line : log.lines) {
        sound += static_cast<size_t>(std::count(kStreamLines.begin(), kStreamLines.end(), line));
      }
      EXPECT_EQ(sound, 4u) << "byte " << at;  // all but the one that was hit
    }
  }
}

TEST(PacketParser, SkipsWhatIsNoPacket) {
  Bytes stream = Hex("00 56 56584C 56584C4B");
  const Bytes packets = Stream();
  stream.insert(stream.end(), packets.begin(), packets.end());
  PacketParser parser(64);
  Log log;
  parser.Feed(stream, log);
  EXPECT_EQ(log.skipped, 9u);
  ASSERT_EQ(log.lines.size(), 6u);
  EXPECT_EQ(log.lines[1], kStreamLines[0]);
}

TEST(PacketParser, TakesNoPacketLongerThanAllowed) {
  PacketParser parser(49);
  Log log;
  parser.Feed(Stream(), log);
  EXPECT_EQ(log.skipped, 90u);
  EXPECT_EQ(log.lines.size(), 5u);  // four packets and the gap
}

}  // namespace
}  // namespace voxeld::display::voxlink
