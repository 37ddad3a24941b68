// What every UsbTransport keeps to, whatever carries it: to hold one to it, add a line at the end.
// The far end of each is the emulated voxlink device.

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <ostream>
#include <string>
#include <utility>
#include <vector>

#include "display/drivers/voxlink/packet.h"
#include "display/drivers/voxlink/protocol.h"
#include "display/emulator/fault_injector.h"
#include "display/emulator/voxlink_device.h"
#include "display/sync/clock.h"
#include "display/sync/fake_clock.h"
#include "display/usb/faulty_transport.h"
#include "display/usb/in_process.h"
#include "display/usb/recording_transport.h"
#include "gtest/gtest.h"
#include "tests/display/usb/transport_rig.h"

namespace voxeld::display {
namespace {

using emulator::Fault;
using sync::kMillisecond;
using sync::kSecond;

// A transport, its device and its time.
class Carrier {
 public:
  virtual ~Carrier() = default;
  virtual UsbTransport& transport() = 0;
  virtual void AddFault(const Fault& fault) = 0;
  virtual void SetPlugged(bool plugged) = 0;
  // Lets things happen until `done`; false: they did not within a generous limit.
  virtual bool RunUntil(const std::function<bool()>& done) = 0;
};

emulator::VoxlinkDeviceConfig SmallDevice() {
  PlanarStack planar;
  planar.width_px = planar.height_px = 4;
  planar.positions_mm = {0, 1};
  emulator::VoxlinkDeviceConfig config;
  config.geometry.shape = planar;
  config.volumes_per_second = 100;
  return config;
}

constexpr size_t kInFlight = size_t{1} << 20;

// What stands between the test and the in-process transport.
using Wrap =
    std::function<std::unique_ptr<UsbTransport>(std::unique_ptr<UsbTransport>, sync::Clock&)>;
std::unique_ptr<UsbTransport> Bare(std::unique_ptr<UsbTransport> inner, sync::Clock& /*clock*/) {
  return inner;
}
std::unique_ptr<UsbTransport> Recorded(std::unique_ptr<UsbTransport> inner, sync::Clock& clock) {
  return std::make_unique<RecordingTransport>(std::move(inner), MemoryRecording().MakeRecorder(),
                                              clock, RecordingTransport::Options{});
}

std::unique_ptr<UsbTransport> Faultless(std::unique_ptr<UsbTransport> inner, sync::Clock& clock) {
  return std::make_unique<FaultyTransport>(std::move(inner), std::vector<TransportFault>{}, clock,
                                           FaultyTransport::Options{});
}

class PumpedCarrier final : public Carrier {
 public:
  explicit PumpedCarrier(const Wrap& wrap = Bare) {
    auto faults = std::make_unique<emulator::FaultInjector>(
        std::make_unique<emulator::VoxlinkDevice>(SmallDevice(), clock_), emulator::FaultPlan{},
        clock_);
    faults_ = faults.get();
    InProcessTransport::Options options;
    options.own_thread = false;
    options.max_bytes_in_flight = kInFlight;
    auto inside = std::make_unique<InProcessTransport>(std::move(faults), clock_, options);
    inside_ = inside.get();
    transport_ = wrap(std::move(inside), clock_);
  }
  UsbTransport& transport() override { return *transport_; }
  void AddFault(const Fault& fault) override {
    inside_->WithDevice([&](UsbDeviceModel&) { faults_->Add(fault); });
  }
  void SetPlugged(bool plugged) override {
    inside_->WithDevice([&](UsbDeviceModel& device) { device.SetPlugged(plugged); });
  }
  bool RunUntil(const std::function<bool()>& done) override {
    const sync::TimeNs end = clock_.Now() + 10 * kSecond;
    while (clock_.Now() < end) {
      const sync::TimeNs next = inside_->Pump();
      if (done()) return true;
      clock_.AdvanceTo(std::min(next, end));
    }
    return false;
  }

 private:
  sync::FakeClock clock_;
  emulator::FaultInjector* faults_ = nullptr;
  InProcessTransport* inside_ = nullptr;
  std::unique_ptr<UsbTransport> transport_;
};

class ThreadedCarrier final : public Carrier {
 public:
  explicit ThreadedCarrier(const Wrap& wrap = Bare) {
    auto faults = std::make_unique<emulator::FaultInjector>(
        std::make_unique<emulator::VoxlinkDevice>(SmallDevice(), clock_), emulator::FaultPlan{},
        clock_);
    faults_ = faults.get();
    InProcessTransport::Options options;
    options.max_bytes_in_flight = kInFlight;
    auto inside = std::make_unique<InProcessTransport>(std::move(faults), clock_, options);
    inside_ = inside.get();
    transport_ = wrap(std::move(inside), clock_);
    transport_->SetWake([this] {
      sync::MutexLock lock(mutex_);
      woken_ = true;
      wake_.NotifyAll();
    });
  }
  ~ThreadedCarrier() override { transport_->SetWake(nullptr); }
  UsbTransport& transport() override { return *transport_; }
  void AddFault(const Fault& fault) override {
    inside_->WithDevice([&](UsbDeviceModel&) { faults_->Add(fault); });
  }
  void SetPlugged(bool plugged) override {
    inside_->WithDevice([&](UsbDeviceModel& device) { device.SetPlugged(plugged); });
  }
  bool RunUntil(const std::function<bool()>& done) override {
    const sync::TimeNs end = clock_.Now() + 20 * kSecond;
    while (!done()) {
      sync::MutexLock lock(mutex_);
      while (!woken_ && clock_.Now() < end) clock_.WaitUntil(mutex_, wake_, end);
      if (!std::exchange(woken_, false)) return false;
    }
    return true;
  }

 private:
  sync::SystemClock clock_;
  sync::Mutex mutex_;
  sync::CondVar wake_;
  bool woken_ VOXELD_GUARDED_BY(mutex_) = false;
  emulator::FaultInjector* faults_ = nullptr;
  InProcessTransport* inside_ = nullptr;
  std::unique_ptr<UsbTransport> transport_;
};

struct CarrierCase {
  std::string name;
  std::function<std::unique_ptr<Carrier>()> make;
};
std::ostream& operator<<(std::ostream& out, const CarrierCase& c) { return out << c.name; }

class TransportConformance : public testing::TestWithParam<CarrierCase> {
 protected:
  void SetUp() override { carrier_ = GetParam().make(); }
  UsbTransport& usb() { return carrier_->transport(); }
  void Open() {
    const absl::Status status = usb().Open();
    ASSERT_TRUE(status.ok()) << status;
  }

  TransferId Must(absl::StatusOr<TransferId> id) {
    EXPECT_TRUE(id.ok()) << id.status();
    return id.ok() ? *id : 0;
  }
  TransferId SubmitIn(UsbSetup setup) {
    Transfer transfer;
    transfer.type = TransferType::kControl;
    transfer.setup = setup;
    transfer.length = setup.length;
    return Must(usb().Submit(std::move(transfer)));
  }
  TransferId SubmitRequest(voxlink::Request request) {
    Transfer transfer;
    transfer.type = TransferType::kControl;
    transfer.setup = {.request_type = voxlink::kRequestOut,
                      .request = static_cast<uint8_t>(request)};
    return Must(usb().Submit(std::move(transfer)));
  }
  TransferId SubmitBulk(TransferBytes data, sync::TimeNs timeout = 0) {
    Transfer transfer;
    transfer.endpoint = voxlink::kBulkOut;
    transfer.data = std::move(data);
    transfer.timeout = timeout;
    return Must(usb().Submit(std::move(transfer)));
  }
  TransferId SubmitEvent() {
    Transfer transfer;
    transfer.type = TransferType::kInterrupt;
    transfer.endpoint = voxlink::kInterruptIn;
    transfer.length = voxlink::kEventSize;
    return Must(usb().Submit(std::move(transfer)));
  }
  // The completion of one transfer; others' are kept in order.
  TransferCompletion Wait(TransferId id) {
    const TransferCompletion* found = nullptr;
    carrier_->RunUntil([&] {
      std::vector<TransferCompletion> drained;
      usb().Drain(drained);
      for (TransferCompletion& completion : drained) {
        order_.push_back(completion.id);
        done_[completion.id] = std::move(completion);
      }
      const auto it = done_.find(id);
      found = it == done_.end() ? nullptr : &it->second;
      return found != nullptr;
    });
    EXPECT_NE(found, nullptr) << "transfer " << id << " did not complete";
    return found == nullptr ? TransferCompletion{} : *found;
  }

  std::unique_ptr<Carrier> carrier_;
  std::map<TransferId, TransferCompletion> done_;
  std::vector<TransferId> order_;
};

constexpr UsbSetup kDeviceDescriptor{
    .request_type = 0x80, .request = 6, .value = 0x0100, .index = 0, .length = 18};

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
  EXPECT_EQ(usb().max_bytes_in_flight(), kInFlight);
  EXPECT_EQ(usb().bytes_in_flight(), 0u);
  const TransferId read = SubmitEvent();  // no session: nothing comes
  EXPECT_EQ(usb().bytes_in_flight(), voxlink::kEventSize);
  Transfer big;
  big.endpoint = voxlink::kBulkOut;
  big.data.resize(kInFlight);
  EXPECT_TRUE(absl::IsResourceExhausted(usb().Submit(std::move(big)).status()));
  usb().Cancel(read);
  EXPECT_EQ(Wait(read).status, TransferStatus::kCancelled);
  EXPECT_EQ(usb().bytes_in_flight(), 0u);
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

TEST_P(TransportConformance, ErrorsPassAndPartialTransfersTell) {
  carrier_->AddFault({.what = Fault::What::kError, .amount = 1});
  carrier_->AddFault({.at = 2, .what = Fault::What::kPartial, .amount = 4});
  Open();
  EXPECT_EQ(Wait(SubmitBulk(TransferBytes(10))).status, TransferStatus::kError);
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
  EXPECT_TRUE(absl::IsNotFound(usb().Open()));
  carrier_->SetPlugged(true);
  Open();
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
  Open();
  Wait(SubmitRequest(voxlink::Request::kStart));
  EXPECT_EQ(Wait(SubmitEvent()).status, TransferStatus::kShort);
  const TransferId read = SubmitEvent();
  EXPECT_EQ(Wait(Must(usb().Reset())).status, TransferStatus::kOk);
  EXPECT_EQ(Wait(read).status, TransferStatus::kCancelled);
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

INSTANTIATE_TEST_SUITE_P(
    Carriers, TransportConformance,
    testing::Values(
        CarrierCase{"InProcessPumped", [] { return std::make_unique<PumpedCarrier>(); }},
        CarrierCase{"InProcessThreaded", [] { return std::make_unique<ThreadedCarrier>(); }},
        CarrierCase{"RecordedPumped", [] { return std::make_unique<PumpedCarrier>(Recorded); }},
        CarrierCase{"RecordedThreaded", [] { return std::make_unique<ThreadedCarrier>(Recorded); }},
        CarrierCase{"FaultlessPumped", [] { return std::make_unique<PumpedCarrier>(Faultless); }},
        CarrierCase{"FaultlessThreaded",
                    [] { return std::make_unique<ThreadedCarrier>(Faultless); }}),
    [](const testing::TestParamInfo<CarrierCase>& param) { return param.param.name; });

}  // namespace
}  // namespace voxeld::display
