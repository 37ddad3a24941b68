// Tests USB/IP as specified by Linux, Documentation/usb/usbip_protocol.rst: every byte here is
// written by hand.
#include "display/emulator/carriers/usbip.h"

#include <sys/socket.h>

#include <memory>
#include <string>

#include "display/emulator/carriers/limits.h"
#include "gtest/gtest.h"
#include "tests/display/emulator/carriers/peer.h"
#include "tests/display/emulator/carriers/puppet.h"

namespace voxeld::display::emulator {
namespace {

constexpr int kHandshakeMs = 10'000;
// Bus number 1, device 2, high speed, 1209:0001, 1.00, class 0, configuration 1 of 1, 1 interface.
const char* const kRecord =
    " 00 00 00 01  00 00 00 02  00 00 00 03  12 09 00 01 01 00  00 00 00  01 01 01";

Bytes Record() {
  Bytes bytes;
  const auto text = [&](const std::string& string, size_t size) {
    for (size_t i = 0; i < size; ++i) {
      bytes.push_back(static_cast<std::byte>(i < string.size() ? string[i] : 0));
    }
  };
  text("/sys/devices/emulated/1-1", 256);
  text("1-1", 32);
  const Bytes rest = Hex(kRecord);
  bytes.insert(bytes.end(), rest.begin(), rest.end());
  return bytes;
}

Bytes Joined(Bytes head, const Bytes& tail) {
  head.insert(head.end(), tail.begin(), tail.end());
  return head;
}

class UsbipHandshake : public testing::Test {
 protected:
  UsbipHandshake() : fd_(peer_.TakeDeviceEnd()) {}
  ~UsbipHandshake() override { ByteStream(fd_).Shutdown(); }
  absl::StatusOr<bool> Answer(const Bytes& request, int limit_ms = kHandshakeMs) {
    peer_.Send(request);
    return AnswerUsbipHandshake(fd_, puppet_, limit_ms);
  }
  absl::StatusOr<bool> AnswerAndEnd(const Bytes& request) {
    peer_.Send(request);
    shutdown(peer_.fd(), SHUT_WR);
    return AnswerUsbipHandshake(fd_, puppet_, kHandshakeMs);
  }

  Peer peer_;
  Puppet puppet_;
  int fd_;
};

TEST_F(UsbipHandshake, ListsTheDevice) {
  const absl::StatusOr<bool> urbs = Answer(Hex("01 11 80 05 00 00 00 00"));
  ASSERT_TRUE(urbs.ok()) << urbs.status();
  EXPECT_FALSE(*urbs);
  const Bytes head = Hex("01 11 00 05 00 00 00 00  00 00 00 01");
  EXPECT_EQ(peer_.Take(), Joined(Joined(head, Record()), Hex("ff 56 01 00")));
}

TEST_F(UsbipHandshake, ListsNothingWhileItIsUnplugged) {
  puppet_.SetPlugged(false);
  ASSERT_TRUE(Answer(Hex("01 11 80 05 00 00 00 00")).ok());
  EXPECT_EQ(peer_.Take(), Hex("01 11 00 05 00 00 00 00  00 00 00 00"));
}

TEST_F(UsbipHandshake, ImportsTheDevice) {
  const absl::StatusOr<bool> urbs = Answer(Hex("01 11 80 03 00 00 00 00  31 2d 31 00*29"));
  ASSERT_TRUE(urbs.ok()) << urbs.status();
  EXPECT_TRUE(*urbs);
  EXPECT_EQ(peer_.Take(), Joined(Hex("01 11 00 03 00 00 00 00"), Record()));
}

TEST_F(UsbipHandshake, RefusesAnotherBusId) {
  EXPECT_TRUE(absl::IsNotFound(Answer(Hex("01 11 80 03 00 00 00 00  32 2d 31 00*29")).status()));
  EXPECT_EQ(peer_.Take(), Hex("01 11 00 03 00 00 00 01"));
}

TEST_F(UsbipHandshake, RefusesABusIdWithoutAnEnd) {
  EXPECT_TRUE(absl::IsNotFound(Answer(Hex("01 11 80 03 00 00 00 00  31*32")).status()));
}

TEST_F(UsbipHandshake, RefusesWhileItIsUnplugged) {
  puppet_.SetPlugged(false);
  EXPECT_TRUE(absl::IsNotFound(Answer(Hex("01 11 80 03 00 00 00 00  31 2d 31 00*29")).status()));
  EXPECT_EQ(peer_.Take(), Hex("01 11 00 03 00 00 00 01"));
}

TEST_F(UsbipHandshake, WrongVersion) {
  const absl::Status status = Answer(Hex("01 06 80 03 00 00 00 00  31 2d 31 00*29")).status();
  EXPECT_TRUE(absl::IsInvalidArgument(status));
  EXPECT_EQ(status.message(), "USB/IP version 0x0106; this is 0x0111");
}

TEST_F(UsbipHandshake, UnknownRequest) {
  const absl::Status status = Answer(Hex("01 11 80 07 00 00 00 00")).status();
  EXPECT_TRUE(absl::IsInvalidArgument(status));
  EXPECT_EQ(status.message(), "USB/IP request 0x8007");
}

TEST_F(UsbipHandshake, Short) {
  EXPECT_TRUE(absl::IsUnavailable(AnswerAndEnd(Hex("01 11 80")).status()));
}

TEST_F(UsbipHandshake, ShortImport) {
  EXPECT_TRUE(absl::IsUnavailable(AnswerAndEnd(Hex("01 11 80 03 00 00 00 00 31")).status()));
}

TEST_F(UsbipHandshake, SilenceIsGivenUp) {
  EXPECT_TRUE(absl::IsUnavailable(Answer(Hex("01"), 20).status()));
}

class Usbip : public testing::Test {
 protected:
  Usbip() : session_(std::make_unique<UsbipSession>(peer_.TakeDeviceEnd(), puppet_)) {}
  absl::Status Receive(const std::string& hex) {
    peer_.Send(Hex(hex));
    return session_->Receive();
  }
  // USBIP_CMD_SUBMIT by hand: seqnum 7, no ISO packets.
  static std::string Submit(const std::string& direction, const std::string& endpoint,
                            const std::string& length, const std::string& setup = "00*8",
                            const std::string& flags = "00 00 00 00") {
    return "00 00 00 01  00 00 00 07  00 01 00 02  00 00 00 " + direction + "  00 00 00 " +
           endpoint + "  " + flags + "  " + length + "  00 00 00 00  ff ff ff ff  00 00 00 00  " +
           setup + " ";
  }
  // The USBIP_RET_SUBMIT for it.
  static Bytes Returned(const std::string& status, const std::string& actual,
                        const std::string& data = "") {
    return Hex("00 00 00 03  00 00 00 07  00*12  " + status + "  " + actual + "  00*20  " + data);
  }

  Peer peer_;
  Puppet puppet_;
  std::unique_ptr<UsbipSession> session_;
};

TEST_F(Usbip, ControlIn) {
  ASSERT_TRUE(Receive(Submit("01", "00", "00 00 00 12", "80 06 00 01 00 00 12 00")).ok());
  EXPECT_EQ(peer_.Take(), Returned("00 00 00 00", "00 00 00 12",
                                   "12 01 10 02 00 00 00 40 09 12 01 00 00 01 01 02 03 01"));
}

TEST_F(Usbip, ControlOut) {
  ASSERT_TRUE(Receive(Submit("00", "00", "00 00 00 02", "41 09 34 12 00 00 02 00") + "aa bb").ok());
  ASSERT_EQ(puppet_.pending.size(), 1u);
  const Puppet::Seen& seen = puppet_.pending.at(7);
  EXPECT_EQ(seen.urb.setup.request_type, 0x41);
  EXPECT_EQ(seen.urb.setup.value, 0x1234);
  EXPECT_EQ(seen.out, Hex("aa bb"));
  puppet_.End(7, TransferStatus::kOk, 2);
  EXPECT_EQ(peer_.Take(), Returned("00 00 00 00", "00 00 00 02"));
}

TEST_F(Usbip, BulkOutInPieces) {
  const Bytes command = Hex(Submit("00", "01", "00 00 00 05") + "01 02 03 04 05");
  for (size_t at = 0; at < command.size(); ++at) {
    EXPECT_TRUE(puppet_.pending.empty());
    peer_.Send(std::span(command).subspan(at, 1));
    ASSERT_TRUE(session_->Receive().ok());
  }
  EXPECT_EQ(puppet_.pending.at(7).out, Hex("01 02 03 04 05"));
  EXPECT_EQ(puppet_.pending.at(7).urb.endpoint, 0x01);
  EXPECT_FALSE(puppet_.pending.at(7).urb.zero_packet);
  puppet_.End(7, TransferStatus::kStall, 3);  // -EPIPE, three of them sent
  EXPECT_EQ(peer_.Take(), Returned("ff ff ff e0", "00 00 00 03"));
}

TEST_F(Usbip, TheFlagForAZeroPacketPasses) {
  ASSERT_TRUE(Receive(Submit("00", "01", "00 00 00 00", "00*8", "00 00 00 40")).ok());
  EXPECT_TRUE(puppet_.pending.at(7).urb.zero_packet);
}

TEST_F(Usbip, InterruptIn) {
  ASSERT_TRUE(Receive(Submit("01", "02", "00 00 00 40")).ok());
  EXPECT_EQ(puppet_.pending.at(7).urb.endpoint, 0x82);
  EXPECT_EQ(puppet_.pending.at(7).urb.length, 64u);
  EXPECT_TRUE(peer_.Take().empty());
  puppet_.End(7, TransferStatus::kShort, 3, Hex("0a 0b 0c"));
  EXPECT_EQ(peer_.Take(), Returned("00 00 00 00", "00 00 00 03", "0a 0b 0c"));
}

TEST_F(Usbip, NoMoreThanWasAskedForIsSent) {
  ASSERT_TRUE(Receive(Submit("01", "02", "00 00 00 02")).ok());
  puppet_.End(7, TransferStatus::kOverflow, 3, Hex("0a 0b 0c"));  // -EOVERFLOW
  EXPECT_EQ(peer_.Take(), Returned("ff ff ff b5", "00 00 00 02", "0a 0b"));
}

TEST_F(Usbip, Statuses) {
  const std::pair<TransferStatus, const char*> statuses[] = {
      {TransferStatus::kError, "ff ff ff b9"},  // -EPROTO
      {TransferStatus::kTimedOut, "ff ff ff b9"},
      {TransferStatus::kCancelled, "ff ff ff fe"},  // -ENOENT
  };
  for (const auto& [status, bytes] : statuses) {
    ASSERT_TRUE(Receive(Submit("01", "02", "00 00 00 40")).ok());
    puppet_.End(7, status);
    EXPECT_EQ(peer_.Take(), Returned(bytes, "00 00 00 00"));
  }
}

TEST_F(Usbip, UnlinkOfWhatIsPending) {
  ASSERT_TRUE(Receive(Submit("01", "02", "00 00 00 40")).ok());
  ASSERT_TRUE(Receive("00 00 00 02  00 00 00 08  00 01 00 02  00*8  00 00 00 07  00*24").ok());
  EXPECT_EQ(puppet_.unlinked, std::vector<uint64_t>{7});
  EXPECT_EQ(peer_.Take(),
            Hex("00 00 00 04  00 00 00 08  00*12  ff ff ff 98  00*24"));  // -ECONNRESET
}

TEST_F(Usbip, UnlinkOfWhatIsDoneOrWasNever) {
  ASSERT_TRUE(Receive("00 00 00 02  00 00 00 08  00 01 00 02  00*8  00 00 00 07  00*24").ok());
  EXPECT_EQ(peer_.Take(), Hex("00 00 00 04  00 00 00 08  00*12  00 00 00 00  00*24"));
}

// Like a cable that is pulled: the end of the connection reports it.
TEST_F(Usbip, AnUnplugEndsWhatIsPendingWithoutAWord) {
  ASSERT_TRUE(Receive(Submit("01", "02", "00 00 00 40")).ok());
  puppet_.SetPlugged(false);
  EXPECT_TRUE(peer_.Take().empty());
  session_ = nullptr;
  EXPECT_TRUE(puppet_.unlinked.empty());
}

TEST_F(Usbip, TheEndOfASessionTakesBackWhatIsPending) {
  ASSERT_TRUE(Receive(Submit("01", "02", "00 00 00 40")).ok());
  session_ = nullptr;
  EXPECT_EQ(puppet_.unlinked, std::vector<uint64_t>{7});
}

TEST_F(Usbip, TheOtherSideGoes) {
  peer_.Send(Hex("00 00 00 01"));
  peer_.Close();
  EXPECT_TRUE(absl::IsUnavailable(session_->Receive()));
}

TEST_F(Usbip, UnknownCommand) {
  EXPECT_TRUE(absl::IsInvalidArgument(Receive("00 00 00 05  00*44")));
}

TEST_F(Usbip, LengthsThatNobodyMeans) {
  EXPECT_TRUE(absl::IsInvalidArgument(Receive(Submit("00", "01", "80 00 00 00"))));
}

TEST_F(Usbip, LengthsThatNobodyMeansIn) {
  EXPECT_TRUE(absl::IsInvalidArgument(Receive(Submit("01", "02", "ff ff ff ff"))));
}

TEST_F(Usbip, AnEndpointThatCannotBe) {
  EXPECT_TRUE(absl::IsInvalidArgument(Receive(Submit("00", "10", "00 00 00 00"))));
}

TEST_F(Usbip, IsochronousTransfers) {
  std::string submit = Submit("00", "01", "00 00 00 00");
  submit.replace(submit.find("ff ff ff ff"), 11, "00 00 00 08");
  EXPECT_TRUE(absl::IsUnimplemented(Receive(submit)));
}

// The device still has the bytes of the first.
TEST_F(Usbip, ANumberTwice) {
  ASSERT_TRUE(Receive(Submit("00", "01", "00 00 00 01") + "aa").ok());
  const absl::Status status = Receive(Submit("00", "01", "00 00 00 01") + "bb");
  EXPECT_TRUE(absl::IsInvalidArgument(status));
  EXPECT_EQ(status.message(), "USB/IP number 7 is in use");
}

TEST_F(Usbip, MoreThanAnyHostLetsWait) {
  Bytes command = Hex(Submit("01", "02", "00 00 00 40"));
  absl::Status status;
  size_t sent = 0;
  for (; status.ok() && sent < 2 * kMostPending; ++sent) {
    command[6] = static_cast<std::byte>(sent >> 8);
    command[7] = static_cast<std::byte>(sent);
    peer_.Send(command);
    status = session_->Receive();
  }
  EXPECT_TRUE(absl::IsResourceExhausted(status)) << status;
  EXPECT_EQ(puppet_.pending.size(), kMostPending);
}

TEST_F(Usbip, AnswersThatNobodyTakes) {
  const Bytes much(1u << 20);
  absl::Status status;
  for (int i = 0; status.ok() && i < 200; ++i) {
    status = Receive(Submit("01", "02", "00 10 00 00"));
    if (status.ok()) puppet_.End(7, TransferStatus::kOk, 0, much);
  }
  EXPECT_TRUE(absl::IsResourceExhausted(status)) << status;
  EXPECT_LE(session_->stream().waiting(), kMostWaiting + 2 * much.size());
}

}  // namespace
}  // namespace voxeld::display::emulator
