// Tests the bytes of recordings: written according to the specifications, read from other writers,
// and refused with an offset where they are wrong.

#include "display/usb/pcapng.h"

#include <cstring>
#include <random>
#include <string>
#include <vector>

#include "gtest/gtest.h"

namespace voxeld::display {
namespace {

using Bytes = std::vector<std::byte>;

Bytes BytesOfText(std::string_view text) {
  const auto bytes = std::as_bytes(std::span(text.data(), text.size()));
  return {bytes.begin(), bytes.end()};
}

UsbPacket SmallPacket(std::span<const std::byte> data) {
  UsbPacket packet;
  packet.time_ns = 1'700'000'000'123'456'789;
  packet.header.id = 77;
  packet.header.type = UsbmonHeader::kSubmit;
  packet.header.xfer_type = UsbmonHeader::kBulk;
  packet.header.epnum = 0x01;
  packet.header.devnum = 3;
  packet.header.busnum = 2;
  packet.header.flag_setup = kUsbmonAbsent;
  packet.header.status = kUsbmonInProgress;
  packet.header.length = static_cast<uint32_t>(data.size());
  packet.data = data;
  return packet;
}

Bytes SmallFile() {
  Bytes file;
  AppendRecordingStart({.application = "voxeld test", .interface_name = "left"}, file);
  const Bytes data = BytesOfText("hello");
  UsbPacket packet = SmallPacket(data);
  AppendUsbPacket(packet, file);
  packet.comment = "pärt";
  packet.left_out_before = 12;
  packet.header.type = UsbmonHeader::kComplete;
  packet.data = {};
  AppendUsbPacket(packet, file);
  AppendStatistics({.first_ns = 5, .last_ns = 6, .received = 14, .left_out = 12}, file);
  return file;
}

uint32_t Word(const Bytes& file, size_t at) {
  uint32_t value;
  std::memcpy(&value, file.data() + at, sizeof(value));
  return value;
}

std::string ErrorOf(const Bytes& file) {
  PcapngReader reader(file);
  while (true) {
    const auto packet = reader.Next();
    if (!packet.ok()) {
      EXPECT_EQ(reader.Next().status(), packet.status());
      return std::string(packet.status().message());
    }
    if (!packet->has_value()) return "";
  }
}

// Byte for byte, by hand from draft-ietf-opsawg-pcapng and usbmon.rst.
TEST(Pcapng, AFileIsWhatTheSpecificationsSay) {
  Bytes file;
  AppendRecordingStart({.application = "abc", .interface_name = "n"}, file);
  const unsigned char start[] = {
      0x0A, 0x0D, 0x0D, 0x0A, 40,   0,    0,    0,    0x4D, 0x3C, 0x2B, 0x1A, 1,   0,   0,   0,
      0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 4,    0,    3,    0,    'a', 'b', 'c', 0,
      0,    0,    0,    0,    40,   0,    0,    0,    1,    0,    0,    0,    40,  0,   0,   0,
      220,  0,    0,    0,    0,    0,    0,    0,    2,    0,    1,    0,    'n', 0,   0,   0,
      9,    0,    1,    0,    9,    0,    0,    0,    0,    0,    0,    0,    40,  0,   0,   0};
  ASSERT_EQ(file.size(), sizeof(start));
  EXPECT_EQ(std::memcmp(file.data(), start, sizeof(start)), 0);

  file.clear();
  const Bytes data = BytesOfText("hello");
  AppendUsbPacket(SmallPacket(data), file);
  ASSERT_EQ(file.size(), 32u + 64 + 8);
  EXPECT_EQ(Word(file, 0), 6u);
  EXPECT_EQ(Word(file, 4), file.size());
  EXPECT_EQ(Word(file, file.size() - 4), file.size());
  EXPECT_EQ(Word(file, 8), 0u);
  EXPECT_EQ(uint64_t{Word(file, 12)} << 32 | Word(file, 16), 1'700'000'000'123'456'789u);
  EXPECT_EQ(Word(file, 20), 69u);
  EXPECT_EQ(Word(file, 24), 69u);
  const std::byte* const header = file.data() + 28;
  EXPECT_EQ(Word(file, 28), 77u);
  EXPECT_EQ(std::to_integer<char>(header[8]), 'S');
  EXPECT_EQ(std::to_integer<int>(header[9]), 3);
  EXPECT_EQ(std::to_integer<int>(header[10]), 0x01);
  EXPECT_EQ(std::to_integer<int>(header[11]), 3);
  EXPECT_EQ(Word(file, 28 + 12), uint32_t{'-'} << 16 | 2u);
  EXPECT_EQ(Word(file, 28 + 16), 1'700'000'000u);
  EXPECT_EQ(Word(file, 28 + 24), 123'456u);
  EXPECT_EQ(static_cast<int32_t>(Word(file, 28 + 28)), -115);
  EXPECT_EQ(Word(file, 28 + 32), 5u);
  EXPECT_EQ(Word(file, 28 + 36), 5u);
  EXPECT_EQ(std::memcmp(header + 64, "hello\0\0\0", 8), 0);
  EXPECT_LE(file.size(), UsbPacketBlockSize(SmallPacket(data)));
}

TEST(Pcapng, WhatIsWrittenIsRead) {
  const Bytes file = SmallFile();
  PcapngReader reader(file);
  auto packet = reader.Next();
  ASSERT_TRUE(packet.ok() && packet->has_value()) << packet.status();
  EXPECT_EQ((*packet)->number, 1u);
  EXPECT_EQ((*packet)->time_ns, 1'700'000'000'123'456'789);
  EXPECT_EQ((*packet)->header.id, 77u);
  EXPECT_EQ((*packet)->header.len_cap, 5u);
  EXPECT_EQ(Bytes((*packet)->data.begin(), (*packet)->data.end()), BytesOfText("hello"));
  EXPECT_EQ((*packet)->comment, "");
  EXPECT_EQ((*packet)->left_out_before, 0u);
  packet = reader.Next();
  ASSERT_TRUE(packet.ok() && packet->has_value()) << packet.status();
  EXPECT_EQ((*packet)->number, 2u);
  EXPECT_EQ((*packet)->comment, "pärt");
  EXPECT_EQ((*packet)->left_out_before, 12u);
  EXPECT_TRUE((*packet)->data.empty());
  packet = reader.Next();
  ASSERT_TRUE(packet.ok()) << packet.status();
  EXPECT_FALSE(packet->has_value());
}

// A big-endian section with times in 2^-10 s from an offset on, an unknown block and an unknown
// option, written by hand.
TEST(Pcapng, OtherWritersFilesAreRead) {
  Bytes file;
  const auto put = [&](uint64_t value, int bytes) {
    for (int i = bytes - 1; i >= 0; --i)
      file.push_back(static_cast<std::byte>(i < 8 ? value >> (8 * i) : 0));
  };
  put(0x0A0D0D0A, 4), put(28, 4), put(0x1A2B3C4D, 4), put(1, 2), put(0, 2), put(~0ull, 8);
  put(28, 4);
  put(0x0BADCAFE, 4), put(16, 4), put(7, 4), put(16, 4);
  put(1, 4), put(48, 4), put(220, 2), put(0, 2), put(0, 4);
  put(9, 2), put(1, 2), put(0x8A, 1), put(0, 3);
  put(14, 2), put(8, 2), put(1000, 8), put(0, 4), put(0, 4), put(48, 4);
  put(6, 4), put(32 + 64 + 12, 4), put(0, 4), put(0, 4), put(3 * 1024 + 512, 4);
  put(64, 4), put(64, 4);
  put(0x1122334455667788, 8), put('C', 1), put(2, 1), put(0x80, 1), put(9, 1), put(4, 2);
  put('-', 1), put('>', 1), put(0, 8), put(0, 4), put(static_cast<uint32_t>(-32), 4), put(18, 4);
  put(0, 4), put(0, 24);
  put(2988, 2), put(4, 2), put(1, 4), put(0, 4), put(32 + 64 + 12, 4);

  PcapngReader reader(file);
  const auto packet = reader.Next();
  ASSERT_TRUE(packet.ok() && packet->has_value()) << packet.status();
  EXPECT_EQ((*packet)->time_ns, 1'003'500'000'000);
  EXPECT_EQ((*packet)->header.id, 0x1122334455667788u);
  EXPECT_EQ((*packet)->header.type, 'C');
  EXPECT_EQ((*packet)->header.busnum, 4);
  EXPECT_EQ((*packet)->header.status, -32);
  EXPECT_EQ((*packet)->header.length, 18u);
  EXPECT_EQ(ErrorOf(file), "");
}

TEST(Pcapng, ErrorsSayWhereAndWhat) {
  EXPECT_EQ(ErrorOf({}),
            "recording, offset 0: the file is empty; it must begin with a section header");
  EXPECT_EQ(ErrorOf(BytesOfText("GIF89a, not pcapng")),
            "recording, offset 0: block type 0x38464947; a pcapng file begins with a section "
            "header (0x0A0D0D0A)");
  EXPECT_EQ(ErrorOf(Bytes(5)),
            "recording, offset 0: the file ends in a block's head: 5 of 12 bytes");
  const Bytes good = SmallFile();
  const auto with = [&](size_t at, uint32_t value) {
    Bytes file = good;
    std::memcpy(file.data() + at, &value, sizeof(value));
    return ErrorOf(file);
  };
  EXPECT_EQ(ErrorOf(good), "");
  EXPECT_EQ(with(8, 7),
            "recording, offset 8: the byte-order magic is 0x7; it must be 0x1A2B3C4D in either "
            "order");
  EXPECT_EQ(with(12, 2), "recording, offset 12: pcapng's major version is 2; 1 can be read");
  const size_t interface = Word(good, 4);
  EXPECT_EQ(with(interface + 4, 13),
            "recording, offset " + std::to_string(interface + 4) +
                ": a block's length is 13; it must be a multiple of 4 and at least 12");
  const size_t packet = interface + Word(good, interface + 4);
  EXPECT_EQ(with(packet + 4, 4000), "recording, offset " + std::to_string(packet + 4) +
                                        ": a block's length is 4000, but the file has only " +
                                        std::to_string(good.size() - packet) + " bytes from there");
  EXPECT_EQ(with(packet + 8, 1), "recording, offset " + std::to_string(packet + 8) +
                                     ": a packet of interface 1; there are 1");
  EXPECT_EQ(with(packet + 20, 1000), "recording, offset " + std::to_string(packet + 20) +
                                         ": a packet of 1000 bytes in a block with 72");
  EXPECT_EQ(with(packet + 20, 10), "recording, offset " + std::to_string(packet + 20) +
                                       ": a packet of 10 bytes; usbmon's header alone has 64");
  const uint64_t ticks = uint64_t{0xFFFFFFFF} << 32 | Word(good, packet + 16);
  EXPECT_EQ(with(packet + 12, 0xFFFFFFFF), "recording, offset " + std::to_string(packet + 12) +
                                               ": the packet's time, " + std::to_string(ticks) +
                                               " ticks, lies before 1970 or after 2262");
  EXPECT_EQ(with(interface + 8, 1), "recording, offset " + std::to_string(packet + 8) +
                                        ": a packet of link type 1; only 220 (USB_LINUX_MMAPPED) "
                                        "can be read");
}

TEST(Pcapng, DamagedFilesAreReadOrRefused) {
  const Bytes good = SmallFile();
  for (size_t size = 0; size < good.size(); ++size) {
    ErrorOf(Bytes(good.begin(), good.begin() + static_cast<ptrdiff_t>(size)));
  }
  for (size_t bit = 0; bit < 8 * good.size(); ++bit) {
    Bytes file = good;
    file[bit / 8] ^= static_cast<std::byte>(1 << bit % 8);
    ErrorOf(file);
  }
  std::mt19937 random(1);
  for (int i = 0; i < 20'000; ++i) {
    Bytes file = good;
    for (uint32_t n = random() % 8; n > 0; --n) {
      file[random() % file.size()] = static_cast<std::byte>(random());
    }
    file.resize(random() % (file.size() + 1));
    ErrorOf(file);
  }
}

TEST(Usbmon, StatusesGoThereAndBack) {
  for (int i = 0; i <= static_cast<int>(TransferStatus::kDisconnected); ++i) {
    const auto status = static_cast<TransferStatus>(i);
    EXPECT_EQ(StatusOfUsbmon(UsbmonStatus(status), status == TransferStatus::kShort), status);
  }
  EXPECT_EQ(StatusOfUsbmon(-104, false), TransferStatus::kCancelled);
  EXPECT_EQ(StatusOfUsbmon(-19, false), TransferStatus::kDisconnected);
  EXPECT_EQ(StatusOfUsbmon(-84, false), TransferStatus::kError);
  EXPECT_EQ(StatusOfUsbmon(INT32_MIN, false), TransferStatus::kError);
  for (const absl::StatusCode code :
       {absl::StatusCode::kResourceExhausted, absl::StatusCode::kUnavailable,
        absl::StatusCode::kFailedPrecondition, absl::StatusCode::kInvalidArgument,
        absl::StatusCode::kInternal}) {
    EXPECT_EQ(StatusOfRefusal(UsbmonRefusal(absl::Status(code, "x"))).code(), code);
  }
  const UsbSetup setup{
      .request_type = 0xC1, .request = 2, .value = 0x1234, .index = 0x56, .length = 0x789A};
  const UsbSetup back = SetupOfBytes(SetupBytes(setup));
  EXPECT_EQ(SetupBytes(setup), (std::array<uint8_t, 8>{0xC1, 2, 0x34, 0x12, 0x56, 0, 0x9A, 0x78}));
  EXPECT_EQ(back.value, setup.value);
  EXPECT_EQ(back.length, setup.length);
}

}  // namespace
}  // namespace voxeld::display
