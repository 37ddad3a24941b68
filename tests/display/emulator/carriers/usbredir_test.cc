// Tests usbredir with the parser that QEMU uses, on the host's side.
#include "display/emulator/carriers/usbredir.h"

#include <memory>

#include "display/emulator/carriers/limits.h"
#include "gtest/gtest.h"
#include "tests/display/emulator/carriers/peer.h"
#include "tests/display/emulator/carriers/puppet.h"
#include "tests/display/emulator/carriers/usbredir_host.h"

namespace voxeld::display::emulator {
namespace {

class Usbredir : public testing::Test {
 protected:
  Usbredir()
      : session_(std::make_unique<UsbredirSession>(peer_.TakeDeviceEnd(), puppet_)), host_(peer_) {}
  absl::Status Receive() {
    const absl::Status status = session_->Receive();
    EXPECT_TRUE(host_.Read());
    return status;
  }
  void Greet() {
    host_.Write();
    ASSERT_TRUE(Receive().ok());
  }
  void EndOnly(uint8_t endpoint, TransferStatus status, uint32_t actual = 0, const Bytes& in = {}) {
    ASSERT_NE(puppet_.Only(endpoint), 0u);
    puppet_.End(puppet_.Only(endpoint), status, actual, in);
    session_->ReadOn();
    EXPECT_TRUE(host_.Read());
  }

  Peer peer_;
  Puppet puppet_;
  std::unique_ptr<UsbredirSession> session_;
  UsbredirHost host_;
};

TEST_F(Usbredir, TellsOfTheDevice) {
  Greet();
  ASSERT_TRUE(host_.device.has_value());
  EXPECT_EQ(host_.device->speed, usb_redir_speed_high);
  EXPECT_EQ(host_.device->vendor_id, 0x1209);
  EXPECT_EQ(host_.device->product_id, 0x0001);
  EXPECT_EQ(host_.device->device_version_bcd, 0x0100);
  ASSERT_EQ(uint32_t{host_.interfaces.interface_count}, 1u);
  EXPECT_EQ(host_.interfaces.interface_class[0], 0xFF);
  EXPECT_EQ(host_.endpoints.type[0x01], usb_redir_type_bulk);
  EXPECT_EQ(uint16_t{host_.endpoints.max_packet_size[0x01]}, 512);
  EXPECT_EQ(host_.endpoints.type[0x12], usb_redir_type_interrupt);  // IN 2
  EXPECT_EQ(host_.endpoints.interval[0x12], 1);
  EXPECT_EQ(host_.endpoints.type[0x03], usb_redir_type_invalid);
}

TEST_F(Usbredir, SaysNothingOfADeviceThatIsNotThere) {
  puppet_.SetPlugged(false);
  Greet();
  EXPECT_EQ(host_.connects, 0);
  puppet_.SetPlugged(true);
  session_->SetPlugged(true);
  ASSERT_TRUE(Receive().ok());
  EXPECT_EQ(host_.connects, 1);
}

TEST_F(Usbredir, PluggedInBeforeTheGreetingItIsToldOfOnce) {
  session_->SetPlugged(true);
  Greet();
  EXPECT_EQ(host_.connects, 1);
}

TEST_F(Usbredir, Control) {
  Greet();
  host_.Control(5, 0x80, 6, 0x0100, 18);
  host_.Control(6, 0x41, 9, 0x1234, 2, Hex("aa bb"));
  ASSERT_TRUE(Receive().ok());
  ASSERT_EQ(host_.controls.size(), 1u);
  EXPECT_EQ(host_.controls[0].id, 5u);
  EXPECT_EQ(host_.controls[0].status, usb_redir_success);
  EXPECT_EQ(host_.controls[0].data, Hex("12 01 10 02 00 00 00 40 09 12 01 00 00 01 01 02 03 01"));
  ASSERT_NE(puppet_.Only(0), 0u);
  EXPECT_EQ(puppet_.pending.at(puppet_.Only(0)).out, Hex("aa bb"));
  EXPECT_EQ(puppet_.pending.at(puppet_.Only(0)).urb.setup.value, 0x1234);
  EndOnly(0, TransferStatus::kStall);
  ASSERT_EQ(host_.controls.size(), 2u);
  EXPECT_EQ(host_.controls[1].id, 6u);
  EXPECT_EQ(host_.controls[1].status, usb_redir_stall);
}

TEST_F(Usbredir, Bulk) {
  Greet();
  const Bytes data(100'000, std::byte{0x5A});
  host_.BulkOut(9, 0x01, data);
  ASSERT_TRUE(Receive().ok());
  ASSERT_NE(puppet_.Only(1), 0u);
  EXPECT_EQ(puppet_.pending.at(puppet_.Only(1)).out, data);
  EndOnly(1, TransferStatus::kOk, 100'000);
  ASSERT_EQ(host_.bulks.size(), 1u);
  EXPECT_EQ(host_.bulks[0].id, 9u);
  EXPECT_EQ(host_.bulks[0].length, 100'000u);
  EXPECT_EQ(host_.bulks[0].status, usb_redir_success);
}

TEST_F(Usbredir, Statuses) {
  const std::pair<TransferStatus, int> statuses[] = {
      {TransferStatus::kStall, usb_redir_stall},
      {TransferStatus::kError, usb_redir_ioerror},
      {TransferStatus::kOverflow, usb_redir_babble},
      {TransferStatus::kTimedOut, usb_redir_timeout},
      {TransferStatus::kCancelled, usb_redir_cancelled},
  };
  Greet();
  for (const auto& [status, told] : statuses) {
    host_.BulkOut(9, 0x01, Hex("01 02 03 04"));
    ASSERT_TRUE(Receive().ok());
    EndOnly(1, status, 3);
    EXPECT_EQ(host_.bulks.back().status, told);
    EXPECT_EQ(host_.bulks.back().length, 3u);
  }
}

TEST_F(Usbredir, Cancel) {
  Greet();
  host_.BulkOut(9, 0x01, Hex("01 02"));
  usbredirparser_send_cancel_data_packet(host_.parser(), 9);
  usbredirparser_send_cancel_data_packet(host_.parser(), 10);  // never existed
  host_.Write();
  ASSERT_TRUE(Receive().ok());
  EXPECT_TRUE(puppet_.pending.empty());
  ASSERT_EQ(host_.bulks.size(), 1u);
  EXPECT_EQ(host_.bulks[0].status, usb_redir_cancelled);
}

TEST_F(Usbredir, InterruptsAreReadOnAndOn) {
  Greet();
  host_.StartInterrupts(3, 0x82);
  host_.StartInterrupts(4, 0x82);  // again: no second read
  ASSERT_TRUE(Receive().ok());
  ASSERT_EQ(host_.receiving.size(), 2u);
  EXPECT_EQ(host_.receiving[0].status, usb_redir_success);
  for (int i = 0; i < 3; ++i) EndOnly(0x82, TransferStatus::kShort, 2, Hex("0a 0b"));
  ASSERT_EQ(host_.interrupts.size(), 3u);
  EXPECT_EQ(host_.interrupts[2].data, Hex("0a 0b"));
  EXPECT_EQ(puppet_.pending.at(puppet_.Only(0x82)).urb.length, 64u);
  host_.StopInterrupts(5, 0x82);
  ASSERT_TRUE(Receive().ok());
  EXPECT_TRUE(puppet_.pending.empty());
  EXPECT_EQ(host_.receiving.size(), 3u);
}

// An endpoint that stalls does so at once, each time that it is read.
TEST_F(Usbredir, AStallIsToldOnceAndReadingGoesOnWhenItIsCleared) {
  Greet();
  host_.StartInterrupts(3, 0x82);
  ASSERT_TRUE(Receive().ok());
  EndOnly(0x82, TransferStatus::kStall);
  ASSERT_EQ(host_.interrupts.size(), 1u);
  EXPECT_EQ(host_.interrupts[0].status, usb_redir_stall);
  EXPECT_TRUE(puppet_.pending.empty());
  host_.Control(4, 0x02, 1, 0, 0, {}, 0x01);  // another endpoint's halt
  ASSERT_TRUE(Receive().ok());
  EndOnly(0, TransferStatus::kOk);
  EXPECT_TRUE(puppet_.pending.empty());
  host_.Control(5, 0x02, 1, 0, 0, {}, 0x82);
  ASSERT_TRUE(Receive().ok());
  EndOnly(0, TransferStatus::kOk);
  EndOnly(0x82, TransferStatus::kShort, 1, Hex("01"));
  EXPECT_EQ(host_.interrupts.size(), 2u);
}

TEST_F(Usbredir, AHaltEndsWithAResetAndWhenReadingIsAskedForAnew) {
  Greet();
  host_.StartInterrupts(3, 0x82);
  ASSERT_TRUE(Receive().ok());
  EndOnly(0x82, TransferStatus::kStall);
  usbredirparser_send_reset(host_.parser());
  host_.Write();
  ASSERT_TRUE(Receive().ok());
  EndOnly(0x82, TransferStatus::kStall);
  host_.StartInterrupts(4, 0x82);
  ASSERT_TRUE(Receive().ok());
  EXPECT_NE(puppet_.Only(0x82), 0u);
}

TEST_F(Usbredir, ErrorsAndCancelledReadsDoNotEndTheReading) {
  Greet();
  host_.StartInterrupts(3, 0x82);
  ASSERT_TRUE(Receive().ok());
  EndOnly(0x82, TransferStatus::kError);
  ASSERT_EQ(host_.interrupts.size(), 1u);
  EXPECT_EQ(host_.interrupts[0].status, usb_redir_ioerror);
  EndOnly(0x82, TransferStatus::kCancelled);  // by the device: it was not requested
  EXPECT_EQ(host_.interrupts.size(), 1u);
  EXPECT_NE(puppet_.Only(0x82), 0u);
}

TEST_F(Usbredir, ConfigurationsAndInterfaces) {
  Greet();
  usb_redir_set_configuration_header configuration{1};
  usbredirparser_send_set_configuration(host_.parser(), 1, &configuration);
  usbredirparser_send_get_configuration(host_.parser(), 2);
  usb_redir_set_alt_setting_header alternate{0, 0};
  usbredirparser_send_set_alt_setting(host_.parser(), 3, &alternate);
  usb_redir_get_alt_setting_header which{0};
  usbredirparser_send_get_alt_setting(host_.parser(), 4, &which);
  host_.Write();
  ASSERT_TRUE(Receive().ok());
  EXPECT_EQ(host_.configurations, (std::vector<uint8_t>{1, 1}));
  EXPECT_EQ(host_.alternates, (std::vector<uint8_t>{0, 0}));
  ASSERT_EQ(puppet_.pending.size(), 2u);  // both reach the device
  EXPECT_EQ(puppet_.pending.begin()->second.urb.setup.request, 9);
  EXPECT_EQ(puppet_.pending.rbegin()->second.urb.setup.request, 11);
}

TEST_F(Usbredir, ResetReachesTheDevice) {
  Greet();
  host_.BulkOut(9, 0x01, Hex("01 02"));
  usbredirparser_send_reset(host_.parser());
  host_.Write();
  ASSERT_TRUE(Receive().ok());
  EXPECT_EQ(puppet_.resets, 1);
  ASSERT_EQ(host_.bulks.size(), 1u);
  EXPECT_EQ(host_.bulks[0].status, usb_redir_cancelled);
}

TEST_F(Usbredir, UnplugAndPlug) {
  Greet();
  host_.BulkOut(9, 0x01, Hex("01 02"));
  host_.StartInterrupts(3, 0x82);
  ASSERT_TRUE(Receive().ok());
  puppet_.SetPlugged(false);
  session_->SetPlugged(false);
  host_.BulkOut(10, 0x01, Hex("03"));  // it cannot know yet
  ASSERT_TRUE(Receive().ok());
  EXPECT_EQ(host_.disconnects, 1);
  EXPECT_TRUE(host_.bulks.empty());
  EXPECT_TRUE(puppet_.pending.empty());
  puppet_.SetPlugged(true);
  session_->SetPlugged(true);
  ASSERT_TRUE(Receive().ok());
  EXPECT_EQ(host_.connects, 2);
  host_.BulkOut(11, 0x01, Hex("04"));
  ASSERT_TRUE(Receive().ok());
  EndOnly(1, TransferStatus::kOk, 1);
  EXPECT_EQ(host_.bulks.size(), 1u);
}

TEST_F(Usbredir, IsochronousStreamsAreRefused) {
  Greet();
  usb_redir_start_iso_stream_header start{0x01, 8, 2};
  usbredirparser_send_start_iso_stream(host_.parser(), 1, &start);
  usb_redir_iso_packet_header packet{};
  packet.endpoint = 0x01;
  packet.length = 2;
  uint8_t bytes[2] = {1, 2};
  usbredirparser_send_iso_packet(host_.parser(), 2, &packet, bytes, sizeof(bytes));
  usb_redir_stop_iso_stream_header stop{0x01};
  usbredirparser_send_stop_iso_stream(host_.parser(), 3, &stop);
  host_.Write();
  ASSERT_TRUE(Receive().ok());
  ASSERT_EQ(host_.streams.size(), 2u);
  EXPECT_EQ(host_.streams[0].status, usb_redir_inval);
  EXPECT_TRUE(puppet_.pending.empty());
}

TEST_F(Usbredir, TheEndOfASessionTakesBackWhatIsPending) {
  Greet();
  host_.BulkOut(9, 0x01, Hex("01 02"));
  ASSERT_TRUE(Receive().ok());
  session_ = nullptr;
  EXPECT_TRUE(puppet_.pending.empty());
}

TEST_F(Usbredir, TheOtherSideGoes) {
  Greet();
  peer_.Close();
  EXPECT_TRUE(absl::IsUnavailable(session_->Receive()));
}

TEST_F(Usbredir, Garbage) {
  peer_.Send(Hex("ff*64"));
  EXPECT_TRUE(absl::IsInvalidArgument(session_->Receive()));
}

TEST_F(Usbredir, MoreThanAnyHostLetsWait) {
  Greet();
  absl::Status status;
  for (size_t i = 0; status.ok() && i < 2 * kMostPending; ++i) {
    host_.BulkOut(i, 0x01, Hex("01"));
    status = session_->Receive();
  }
  EXPECT_TRUE(absl::IsResourceExhausted(status)) << status;
  EXPECT_EQ(puppet_.pending.size(), kMostPending);
}

}  // namespace
}  // namespace voxeld::display::emulator
