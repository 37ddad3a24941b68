// Tests the contents of a recording with a parser that shares no code with the writer.
// transport_conformance_test.cc tests that the wrapped transport is as good as the bare one.

#include "display/usb/recording_transport.h"

#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "display/drivers/voxlink/packet.h"
#include "gtest/gtest.h"
#include "tests/display/usb/transport_rig.h"

namespace voxeld::display {
namespace {

using sync::kMillisecond;

// Returns packets as text, by the offsets of the specifications.
std::vector<std::string> Lines(const std::vector<std::byte>& file) {
  const auto* const bytes = reinterpret_cast<const unsigned char*>(file.data());
  const auto number = [&](size_t at, int size) {
    uint64_t value = 0;
    for (int i = size - 1; i >= 0; --i) value = value << 8 | bytes[at + static_cast<size_t>(i)];
    return value;
  };
  std::vector<std::string> lines;
  for (size_t at = 0; at < file.size(); at += number(at + 4, 4)) {
    if (number(at, 4) != 6) continue;
    const size_t h = at + 28;  // usbmon's header
    const uint64_t time_ns = number(at + 12, 4) << 32 | number(at + 16, 4);
    EXPECT_EQ(number(h + 16, 8), time_ns / 1'000'000'000);
    EXPECT_EQ(number(h + 24, 4), time_ns % 1'000'000'000 / 1000);
    EXPECT_EQ(number(at + 20, 4), number(at + 24, 4));
    EXPECT_EQ(number(h + 36, 4), number(at + 20, 4) - 64);
    EXPECT_EQ(number(h + 48, 8), 0u);
    std::string line =
        absl::StrFormat("%dms %c%d x%d ep%02x %d.%d %c %d/%d", time_ns / 1'000'000, bytes[h + 8],
                        number(h, 8), bytes[h + 9], bytes[h + 10], number(h + 12, 2), bytes[h + 11],
                        bytes[h + 15] == 0 ? '=' : static_cast<char>(bytes[h + 15]),
                        static_cast<int32_t>(number(h + 28, 4)), number(h + 32, 4));
    if (number(h + 56, 4) != 0) absl::StrAppend(&line, " flags", number(h + 56, 4));
    if (bytes[h + 14] == 0) {
      absl::StrAppend(&line, " setup");
      for (int i = 0; i < 8; ++i) absl::StrAppendFormat(&line, " %02x", bytes[h + 40 + i]);
    }
    const size_t size = number(h + 36, 4);
    if (size > 0) absl::StrAppend(&line, " data");
    for (size_t i = 0; i < std::min<size_t>(size, 4); ++i) {
      absl::StrAppendFormat(&line, " %02x", bytes[h + 64 + i]);
    }
    const size_t option = h + 64 + (size + 3) / 4 * 4;
    if (option < at + number(at + 4, 4) - 4 && number(option, 2) == 1) {
      absl::StrAppend(
          &line, " # ",
          std::string(reinterpret_cast<const char*>(bytes) + option + 4, number(option + 2, 2)));
    }
    lines.push_back(line);
  }
  return lines;
}

class Recording : public testing::Test {
 protected:
  void Make() {
    EmulatedCable cable(clock_);
    pump_ = cable.pump;
    usb_ = std::make_unique<RecordingTransport>(
        std::move(cable.transport), recording_.MakeRecorder(), clock_,
        RecordingTransport::Options{.wall_offset_ns = 4 * sync::kSecond, .bus = 7});
    ASSERT_TRUE(usb_->Open().ok());
  }
  TransferCompletion Wait(absl::StatusOr<TransferId> id) {
    EXPECT_TRUE(id.ok()) << id.status();
    clock_.Advance(kMillisecond);
    pump_->Pump();
    std::vector<TransferCompletion> out(1);  // Drain appends
    usb_->Drain(out);
    for (TransferCompletion& completion : out) {
      if (id.ok() && completion.id == *id) return std::move(completion);
    }
    ADD_FAILURE() << "it did not complete";
    return {};
  }
  absl::StatusOr<TransferId> Control(UsbSetup setup, TransferBytes data = {}) {
    Transfer transfer;
    transfer.type = TransferType::kControl;
    transfer.setup = setup;
    transfer.data = std::move(data);
    if ((setup.request_type & 0x80) != 0) transfer.length = setup.length;
    return usb_->Submit(std::move(transfer));
  }
  absl::StatusOr<TransferId> Bulk(TransferBytes data, bool zero_packet = false) {
    Transfer transfer;
    transfer.endpoint = voxlink::kBulkOut;
    transfer.data = std::move(data);
    transfer.zero_packet = zero_packet;
    return usb_->Submit(std::move(transfer));
  }
  absl::StatusOr<TransferId> Event() {
    Transfer transfer;
    transfer.type = TransferType::kInterrupt;
    transfer.endpoint = voxlink::kInterruptIn;
    transfer.length = voxlink::kEventSize;
    return usb_->Submit(std::move(transfer));
  }
  std::vector<std::string> Finish() {
    usb_.reset();
    return Lines(recording_.bytes());
  }

  sync::FakeClock clock_;  // starts at 1 s
  MemoryRecording recording_;
  InProcessTransport* pump_ = nullptr;
  std::unique_ptr<RecordingTransport> usb_;
};

constexpr UsbSetup kStart{.request_type = voxlink::kRequestOut, .request = 5};

TEST_F(Recording, HoldsEverySubmissionAndItsEnd) {
  Make();
  Wait(Control({.request_type = 0x80, .request = 6, .value = 0x0100, .length = 64}));
  Wait(Control({.request_type = 0x80, .request = 6, .value = 0x7700, .length = 18}));
  Wait(Control({.request_type = 0x41, .request = 3, .length = 16}, TransferBytes(16)));
  Wait(Control(kStart));
  Wait(Event());
  TransferBytes packet;
  voxlink::PacketWriter().Plain(packet, voxlink::PacketType::kKeepalive, 0);
  Wait(Bulk(std::move(packet), true));
  Wait(usb_->ClearHalt(0x82));
  Wait(usb_->Reset());
  EXPECT_EQ(Finish(),
            (std::vector<std::string>{
                "5000ms S1 x2 ep80 7.1 < -115/64 flags512 setup 80 06 00 01 00 00 40 00 # opened "
                "1209:0001, revision 0100, serial \"simulated\", path \"in-process\"",
                "5001ms C1 x2 ep80 7.1 = 0/18 data 12 01 00 03",
                "5001ms S2 x2 ep80 7.1 < -115/18 flags512 setup 80 06 00 77 00 00 12 00",
                "5002ms C2 x2 ep80 7.1 = -32/0",
                "5002ms S3 x2 ep00 7.1 = -115/16 setup 41 03 00 00 00 00 10 00 data 00 00 00 00",
                "5003ms C3 x2 ep00 7.1 > -32/0",
                "5003ms S4 x2 ep00 7.1 = -115/0 setup 41 05 00 00 00 00 00 00",
                "5004ms C4 x2 ep00 7.1 > 0/0",
                "5004ms S5 x1 ep82 7.1 < -115/64 flags512",
                "5005ms C5 x1 ep82 7.1 = 0/32 data 01 00 20 00",
                "5005ms S6 x3 ep01 7.1 = -115/40 flags64 data 56 58 4c 4b",
                "5006ms C6 x3 ep01 7.1 > 0/40",
                "5006ms S7 x2 ep00 7.1 = -115/0 setup 02 01 00 00 82 00 00 00",
                "5007ms C7 x2 ep00 7.1 > 0/0",
                "5007ms S8 x2 ep00 7.1 = -115/0 setup 23 03 04 00 00 00 00 00 # port reset, which "
                "its hub is asked for",
                "5008ms C8 x2 ep00 7.1 > 0/0",
            }));
}

TEST_F(Recording, TellsRefusalsCancelsDisconnectsAndCloses) {
  Make();
  const auto read = Event();
  usb_->Cancel(*read);
  EXPECT_EQ(Wait(read).status, TransferStatus::kCancelled);
  Transfer big;
  big.data.resize(usb_->max_bytes_in_flight() + 1);
  big.endpoint = voxlink::kBulkOut;
  EXPECT_TRUE(absl::IsResourceExhausted(usb_->Submit(std::move(big)).status()));
  EXPECT_EQ(big.data.size(), usb_->max_bytes_in_flight() + 1);
  const auto lost = Event();
  pump_->WithDevice([](UsbDeviceModel& device) { device.SetPlugged(false); });
  EXPECT_EQ(Wait(lost).status, TransferStatus::kDisconnected);
  EXPECT_TRUE(absl::IsUnavailable(Control(kStart).status()));
  usb_->Close();
  EXPECT_FALSE(Control(kStart).ok());
  EXPECT_FALSE(usb_->ClearHalt(1).ok());
  EXPECT_FALSE(usb_->Reset().ok());
  pump_->WithDevice([](UsbDeviceModel& device) { device.SetPlugged(true); });
  ASSERT_TRUE(usb_->Open().ok());
  ASSERT_TRUE(Event().ok());
  usb_->Close();
  const std::vector<std::string> lines = Finish();
  ASSERT_EQ(lines.size(), 10u);
  EXPECT_EQ(lines[1], "5001ms C1 x1 ep82 7.1 = -2/0");
  EXPECT_EQ(lines[2], "5001ms S2 x3 ep01 7.1 = -115/16777217 data 00 00 00 00");
  EXPECT_EQ(lines[3],
            "5001ms E2 x3 ep01 7.1 E -12/0 # 16777217 bytes more than the 0 in flight; at most "
            "16777216 may be");
  EXPECT_EQ(lines[5], "5002ms C3 x1 ep82 7.1 = -108/0");
  EXPECT_EQ(lines[6], "5002ms S4 x2 ep00 7.1 = -115/0 setup 41 05 00 00 00 00 00 00");
  EXPECT_EQ(lines[7], "5002ms E4 x2 ep00 7.1 E -19/0 # the device was unplugged");
  EXPECT_EQ(lines[8],
            "5002ms S5 x1 ep82 7.2 < -115/64 flags512 # opened 1209:0001, revision 0100, serial "
            "\"simulated\", path \"in-process\"");
  EXPECT_EQ(lines[9], "5002ms C5 x1 ep82 7.2 = -2/0 # closed before its end was known");
}

TEST_F(Recording, IntoAFileThatCannotBeMadeIsRefused) {
  EmulatedCable cable(clock_);
  const auto recorded =
      RecordToFile("/nonexistent/folder/a.pcapng", std::move(cable.transport), clock_);
  EXPECT_TRUE(absl::IsInvalidArgument(recorded.status())) << recorded.status();
}

TEST_F(Recording, AFileIsBegunWithTheDeviceAndBelongsToOne) {
  const std::string path = testing::TempDir() + "begun.pcapng";
  std::ofstream(path) << "kept";
  const auto size = [&] { return std::filesystem::file_size(path); };
  EmulatedCable cable(clock_), other(clock_);
  const auto first = RecordToFile(path, std::move(cable.transport), clock_);
  const auto second = RecordToFile(path, std::move(other.transport), clock_);
  ASSERT_TRUE(first.ok() && second.ok());
  EXPECT_EQ(size(), 4u);
  ASSERT_TRUE((*first)->Open().ok());
  EXPECT_TRUE(absl::IsFailedPrecondition((*second)->Open()));
  EXPECT_FALSE((*second)->is_open());
  (*first)->Close();
  std::filesystem::remove(path);
}

}  // namespace
}  // namespace voxeld::display
