#include "tests/display/usb/transport_conformance.h"

#include <optional>
#include <utility>

#include "display/drivers/voxlink/packet.h"

namespace voxeld::display {
namespace {

using emulator::Fault;
using sync::kMillisecond;
using sync::kSecond;

TEST_P(TransportConformance, OpensOnceClosesAndOpensAgain) {
  EXPECT_FALSE(usb().is_open());
  EXPECT_FALSE(usb().Submit(Transfer{}).ok());
  Open();
  EXPECT_TRUE(usb().is_open());
  EXPECT_FALSE(usb().Open().ok());
  usb().Close();
  usb().Close();
  EXPECT_FALSE(usb().is_open());
  Open();
  EXPECT_EQ(Wait(SubmitIn(kDeviceDescriptor)).status, TransferStatus::kOk);
}

TEST_P(TransportConformance, ReadsDescriptors) {
  Open();
  const TransferCompletion whole = Wait(SubmitIn(kDeviceDescriptor));
  EXPECT_EQ(whole.type, TransferType::kControl);
  EXPECT_EQ(whole.status, TransferStatus::kOk);
  ASSERT_EQ(whole.data.size(), 18u);
  EXPECT_EQ(whole.actual_length, 18u);
  EXPECT_EQ(std::to_integer<int>(whole.data[1]), 1);
  UsbSetup longer = kDeviceDescriptor;
  longer.length = 64;
  const TransferCompletion partial = Wait(SubmitIn(longer));
  EXPECT_EQ(partial.status, TransferStatus::kShort);
  EXPECT_EQ(partial.data.size(), 18u);
}

TEST_P(TransportConformance, ARefusedRequestStallsAndTheNextOneWorks) {
  Open();
  UsbSetup bad = kDeviceDescriptor;
  bad.value = 0x7700;
  EXPECT_EQ(Wait(SubmitIn(bad)).status, TransferStatus::kStall);
  EXPECT_EQ(Wait(SubmitIn(kDeviceDescriptor)).status, TransferStatus::kOk);
}

TEST_P(TransportConformance, BulkBytesArriveAndTheBufferComesBack) {
  Open();
  Wait(SubmitRequest(voxlink::Request::kStart));
  const TransferId ready = SubmitEvent();
  EXPECT_EQ(Wait(ready).status, TransferStatus::kShort);
  TransferBytes packet;
  voxlink::PacketWriter writer;
  writer.Plain(packet, voxlink::PacketType::kAbort, 77);
  const std::byte* const memory = packet.data();
  const TransferId event = SubmitEvent();
  const TransferCompletion sent = Wait(SubmitBulk(std::move(packet)));
  EXPECT_EQ(sent.status, TransferStatus::kOk);
  EXPECT_EQ(sent.actual_length, 40u);
  EXPECT_EQ(sent.endpoint, voxlink::kBulkOut);
  EXPECT_EQ(done_[sent.id].data.data(), memory);
  TransferCompletion answer = Wait(event);
  while (voxlink::Load<voxlink::EventHeader>(answer.data).type !=
         static_cast<uint8_t>(voxlink::EventType::kAborted)) {
    answer = Wait(SubmitEvent());  // a sweep came before
  }
  EXPECT_EQ(voxlink::Load<voxlink::VolumeEvent>(
                std::span(answer.data).subspan(sizeof(voxlink::EventHeader)))
                .volume,
            77u);
}

TEST_P(TransportConformance, CompletionsOfAnEndpointKeepTheirOrder) {
  Open();
  std::vector<TransferId> sent;
  for (int i = 0; i < 50; ++i) sent.push_back(SubmitBulk(TransferBytes(100)));
  Wait(sent.back());
  EXPECT_EQ(order_, sent);
}

TEST_P(TransportConformance, BytesInFlightAreCountedAndCapped) {
  Open();
  const size_t told = carrier_->limits().max_bytes_in_flight;
  if (told != 0) {
    EXPECT_EQ(usb().max_bytes_in_flight(), told);
  }
  EXPECT_EQ(usb().bytes_in_flight(), 0u);
  const TransferId read = SubmitEvent();  // without a session no event comes
  EXPECT_EQ(usb().bytes_in_flight(), voxlink::kEventSize);
  Transfer big;
  big.endpoint = voxlink::kBulkOut;
  big.data.resize(usb().max_bytes_in_flight());
  EXPECT_TRUE(absl::IsResourceExhausted(usb().Submit(std::move(big)).status()));
  usb().Cancel(read);
  EXPECT_EQ(Wait(read).status, TransferStatus::kCancelled);
  EXPECT_EQ(usb().bytes_in_flight(), 0u);
  if (told == 0) big.data.resize(size_t{1} << 20);  // the transport's own memory counts as well
  EXPECT_EQ(Wait(Must(usb().Submit(std::move(big)))).status, TransferStatus::kOk);
}

TEST_P(TransportConformance, CancelOfUnknownAndFinishedTransfersIsNothing) {
  Open();
  usb().Cancel(999);
  const TransferId id = SubmitBulk(TransferBytes(10));
  EXPECT_EQ(Wait(id).status, TransferStatus::kOk);
  usb().Cancel(id);
  EXPECT_EQ(Wait(SubmitIn(kDeviceDescriptor)).status, TransferStatus::kOk);
  EXPECT_EQ(order_.size(), 2u);
}

TEST_P(TransportConformance, TransfersTimeOut) {
  carrier_->AddFault({.what = Fault::What::kNak, .amount = 5 * kSecond});
  Open();
  EXPECT_EQ(Wait(SubmitBulk(TransferBytes(10), 20 * kMillisecond)).status,
            TransferStatus::kTimedOut);
}

TEST_P(TransportConformance, AHaltLastsUntilItIsCleared) {
  carrier_->AddFault({.what = Fault::What::kStall});
  Open();
  EXPECT_EQ(Wait(SubmitBulk(TransferBytes(10))).status, TransferStatus::kStall);
  EXPECT_EQ(Wait(SubmitBulk(TransferBytes(10))).status, TransferStatus::kStall);
  EXPECT_EQ(Wait(Must(usb().ClearHalt(voxlink::kBulkOut))).status, TransferStatus::kOk);
  EXPECT_EQ(Wait(SubmitBulk(TransferBytes(10))).status, TransferStatus::kOk);
}

TEST_P(TransportConformance, ErrorsPass) {
  // More than any host controller retries.
  const uint64_t count = carrier_->limits().errors_are_retried ? 40 : 1;
  carrier_->AddFault({.what = Fault::What::kError, .amount = count});
  Open();
  EXPECT_EQ(Wait(SubmitBulk(TransferBytes(10))).status, TransferStatus::kError);
}

TEST_P(TransportConformance, PartialTransfersTell) {
  carrier_->AddFault({.what = Fault::What::kPartial, .amount = 4});
  Open();
  const TransferCompletion partial = Wait(SubmitBulk(TransferBytes(10)));
  EXPECT_EQ(partial.status, TransferStatus::kStall);
  EXPECT_EQ(partial.actual_length, 4u);
}

TEST_P(TransportConformance, AnUnpluggedDeviceIsGoneForGoodAndANewOneOpens) {
  Open();
  const TransferId read = SubmitEvent();
  carrier_->SetPlugged(false);
  EXPECT_EQ(Wait(read).status, TransferStatus::kDisconnected);
  EXPECT_TRUE(carrier_->RunUntil([&] { return !usb().Submit(Transfer{}).ok(); }));
  carrier_->SetPlugged(true);
  EXPECT_FALSE(usb().Submit(Transfer{}).ok());  // a stale handle stays stale
  usb().Close();
  carrier_->SetPlugged(false);
  EXPECT_TRUE(carrier_->RunUntil([&] {
    const bool gone = absl::IsNotFound(usb().Open());
    usb().Close();
    return gone;
  }));
  carrier_->SetPlugged(true);
  EXPECT_TRUE(carrier_->RunUntil([&] { return usb().Open().ok(); }));
  EXPECT_EQ(Wait(SubmitIn(kDeviceDescriptor)).status, TransferStatus::kOk);
}

TEST_P(TransportConformance, CloseDiscardsWhatIsPending) {
  carrier_->AddFault({.what = Fault::What::kNak, .amount = 5 * kSecond});
  Open();
  SubmitEvent();
  SubmitBulk(TransferBytes(10));
  usb().Close();
  std::vector<TransferCompletion> drained;
  EXPECT_EQ(usb().Drain(drained), 0u);
  EXPECT_EQ(usb().bytes_in_flight(), 0u);
  Open();
  EXPECT_EQ(Wait(SubmitIn(kDeviceDescriptor)).status, TransferStatus::kOk);
  EXPECT_EQ(order_.size(), 1u);
}

TEST_P(TransportConformance, CloseLetsARequestGoOut) {
  Open();
  Wait(SubmitRequest(voxlink::Request::kStart));
  EXPECT_EQ(Wait(SubmitEvent()).status, TransferStatus::kShort);
  SubmitRequest(voxlink::Request::kStop);
  usb().Close();
  Open();
  const TransferCompletion status =
      Wait(SubmitIn({.request_type = voxlink::kRequestIn,
                     .request = static_cast<uint8_t>(voxlink::Request::kGetStatus),
                     .length = sizeof(voxlink::Status)}));
  EXPECT_EQ(voxlink::Load<voxlink::Status>(status.data).running, 0);
}

TEST_P(TransportConformance, ResetCancelsWhatIsInFlightAndTheDeviceStartsAnew) {
  // No event arrives in between.
  carrier_->AddFault(
      {.endpoint = voxlink::kInterruptIn, .what = Fault::What::kNak, .amount = 60 * kSecond});
  Open();
  const auto running = [&] {
    const TransferCompletion status =
        Wait(SubmitIn({.request_type = voxlink::kRequestIn,
                       .request = static_cast<uint8_t>(voxlink::Request::kGetStatus),
                       .length = sizeof(voxlink::Status)}));
    return voxlink::Load<voxlink::Status>(status.data).running;
  };
  Wait(SubmitRequest(voxlink::Request::kStart));
  EXPECT_EQ(running(), 1);
  const TransferId read = SubmitEvent();
  EXPECT_EQ(Wait(Must(usb().Reset())).status, TransferStatus::kOk);
  EXPECT_EQ(Wait(read).status, TransferStatus::kCancelled);
  EXPECT_EQ(running(), 0);
}

TEST_P(TransportConformance, WhatIsSubmittedBehindAResetGoesOutAfterIt) {
  Open();
  Wait(SubmitRequest(voxlink::Request::kStart));
  const TransferId reset = Must(usb().Reset());
  const TransferId status = SubmitIn({.request_type = voxlink::kRequestIn,
                                      .request = static_cast<uint8_t>(voxlink::Request::kGetStatus),
                                      .length = sizeof(voxlink::Status)});
  const TransferId bulk = SubmitBulk(TransferBytes(10));
  EXPECT_EQ(Wait(reset).status, TransferStatus::kOk);
  const TransferCompletion answer = Wait(status);
  ASSERT_EQ(answer.status, TransferStatus::kOk);
  EXPECT_EQ(voxlink::Load<voxlink::Status>(answer.data).running, 0);
  EXPECT_EQ(Wait(bulk).status, TransferStatus::kOk);
}

TEST_P(TransportConformance, WhatIsSubmittedBehindAClearedHaltGoesOutBeforeClose) {
  Open();
  Wait(SubmitRequest(voxlink::Request::kStart));
  Must(usb().ClearHalt(voxlink::kBulkOut));
  Must(usb().ClearHalt(voxlink::kInterruptIn));
  SubmitRequest(voxlink::Request::kStop);
  usb().Close();
  Open();
  const TransferCompletion status =
      Wait(SubmitIn({.request_type = voxlink::kRequestIn,
                     .request = static_cast<uint8_t>(voxlink::Request::kGetStatus),
                     .length = sizeof(voxlink::Status)}));
  EXPECT_EQ(voxlink::Load<voxlink::Status>(status.data).running, 0);
}

TEST_P(TransportConformance, AnArrivalIsToldOnceWhileNothingIsOpen) {
  Open();
  EXPECT_FALSE(usb().TakeArrival());
  carrier_->SetPlugged(false);
  EXPECT_TRUE(carrier_->RunUntil([&] { return !usb().Submit(Transfer{}).ok(); }));
  usb().Close();
  carrier_->SetPlugged(true);
  EXPECT_TRUE(carrier_->RunUntil([&] { return usb().TakeArrival(); }));
  EXPECT_FALSE(usb().TakeArrival());
  Open();
}

TEST_P(TransportConformance, OverflowsAreTold) {
  carrier_->AddFault(
      {.endpoint = voxlink::kInterruptIn, .what = Fault::What::kBabble, .amount = 1});
  Open();
  Wait(SubmitRequest(voxlink::Request::kStart));
  EXPECT_EQ(Wait(SubmitEvent()).status, TransferStatus::kOverflow);
  EXPECT_EQ(Wait(SubmitEvent()).status, TransferStatus::kShort);
}

TEST_P(TransportConformance, BuffersHaveMemoryAndOutliveTheirDevice) {
  Open();
  TransferBytes buffer = usb().TakeBuffer(4096);
  EXPECT_TRUE(buffer.empty());
  EXPECT_GE(buffer.capacity(), 4096u);
  std::vector<TransferBytes> many;
  for (int i = 0; i < 40; ++i) {
    many.push_back(usb().TakeBuffer(size_t{256} << 10));
    many.back().resize(size_t{256} << 10);
  }
  usb().Close();
  buffer.resize(4096);
  many[39][5] = std::byte{7};
  EXPECT_EQ(many[39][5], std::byte{7});
}

TEST_P(TransportConformance, WhatIsRefusedIsAsItWas) {
  Transfer transfer;
  transfer.data.resize(77);
  EXPECT_FALSE(usb().Submit(std::move(transfer)).ok());
  EXPECT_EQ(transfer.data.size(), 77u);
}

TEST_P(TransportConformance, StatusesHaveNames) {
  EXPECT_STREQ(TransferStatusName(TransferStatus::kDisconnected), "disconnected");
  EXPECT_FALSE(usb().identity().path.empty());
}

}  // namespace
}  // namespace voxeld::display
