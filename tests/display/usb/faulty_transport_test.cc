// Tests a transport that fails at a chosen place, and the driver over it: it always recovers, shows
// the newest volume, and reports each volume once.

#include "display/usb/faulty_transport.h"

#include <ostream>
#include <string>
#include <vector>

#include "display/api/pixels.h"
#include "gtest/gtest.h"
#include "tests/display/usb/transport_rig.h"

namespace voxeld::display {
namespace {

using sync::kMillisecond;
using sync::kSecond;
using Where = TransportFault::Where;

class Faulty : public testing::Test {
 protected:
  void Make(std::vector<TransportFault> plan, bool own_thread = false) {
    EmulatedCable cable(clock_);
    pump_ = cable.pump;
    usb_ = std::make_unique<FaultyTransport>(std::move(cable.transport), std::move(plan), clock_,
                                             FaultyTransport::Options{.own_thread = own_thread});
  }
  absl::StatusOr<TransferId> Read() {
    Transfer transfer;
    transfer.type = TransferType::kControl;
    transfer.setup = {.request_type = 0x80, .request = 6, .value = 0x0100, .length = 18};
    transfer.length = 18;
    return usb_->Submit(std::move(transfer));
  }
  absl::StatusOr<TransferId> Write() {
    Transfer transfer;
    transfer.endpoint = 0x01;
    transfer.data.resize(10);
    return usb_->Submit(std::move(transfer));
  }
  std::vector<TransferCompletion> Drain() {
    pump_->Pump();
    usb_->Pump();
    std::vector<TransferCompletion> out;
    usb_->Drain(out);
    return out;
  }

  sync::FakeClock clock_;
  InProcessTransport* pump_ = nullptr;
  std::unique_ptr<FaultyTransport> usb_;
};

TEST_F(Faulty, RefusesWhatIsPlanned) {
  Make({{.where = Where::kOpen, .count = 2, .refusal = absl::PermissionDeniedError("not yours")},
        {.where = Where::kSubmit, .at = 2, .refusal = absl::ResourceExhaustedError("no memory")}});
  EXPECT_EQ(usb_->Open(), absl::PermissionDeniedError("not yours"));
  EXPECT_EQ(usb_->Open(), absl::PermissionDeniedError("not yours"));
  EXPECT_TRUE(usb_->Open().ok());
  EXPECT_TRUE(Read().ok());
  Transfer kept;
  kept.data.resize(5);
  EXPECT_EQ(usb_->Submit(std::move(kept)).status(), absl::ResourceExhaustedError("no memory"));
  EXPECT_EQ(kept.data.size(), 5u);
  EXPECT_TRUE(usb_->ClearHalt(1).ok());
  EXPECT_EQ(usb_->hits(), 3u);
}

TEST_F(Faulty, CompletionsSayWhatIsPlanned) {
  Make({{.where = Where::kCompletion, .at = 1, .status = TransferStatus::kStall},
        {.where = Where::kCompletion,
         .at = 2,
         .status = TransferStatus::kTimedOut,
         .actual_length = 4},
        {.where = Where::kCompletion,
         .at = 3,
         .status = TransferStatus::kShort,
         .actual_length = 7}});
  ASSERT_TRUE(usb_->Open().ok());
  ASSERT_TRUE(Read().ok());
  std::vector<TransferCompletion> out = Drain();
  ASSERT_EQ(out.size(), 1u);
  EXPECT_EQ(out[0].status, TransferStatus::kStall);
  EXPECT_TRUE(out[0].data.empty());
  ASSERT_TRUE(Write().ok());
  out = Drain();
  ASSERT_EQ(out.size(), 1u);
  EXPECT_EQ(out[0].status, TransferStatus::kTimedOut);
  EXPECT_EQ(out[0].actual_length, 4u);
  EXPECT_EQ(out[0].data.size(), 10u);
  ASSERT_TRUE(Read().ok());
  out = Drain();
  ASSERT_EQ(out.size(), 1u);
  EXPECT_EQ(out[0].status, TransferStatus::kShort);
  EXPECT_EQ(out[0].data.size(), 7u);
  ASSERT_TRUE(Read().ok());
  EXPECT_EQ(Drain()[0].status, TransferStatus::kOk);
}

TEST_F(Faulty, HoldsBackAndKeepsAnEndpointsOrder) {
  Make({{.where = Where::kCompletion, .at = 1, .hold = 50 * kMillisecond}});
  ASSERT_TRUE(usb_->Open().ok());
  const TransferId first = *Write();
  EXPECT_TRUE(Drain().empty());
  const TransferId second = *Write();
  const TransferId other = *Read();
  std::vector<TransferCompletion> out = Drain();
  ASSERT_EQ(out.size(), 1u);
  EXPECT_EQ(out[0].id, other);
  EXPECT_EQ(usb_->Pump(), clock_.Now() + 50 * kMillisecond);
  bool woken = false;
  usb_->SetWake([&] { woken = true; });
  clock_.Advance(50 * kMillisecond);
  usb_->Pump();
  EXPECT_TRUE(woken);
  out.clear();
  EXPECT_EQ(usb_->Drain(out), 2u);
  EXPECT_EQ(out[0].id, first);
  EXPECT_EQ(out[1].id, second);
  EXPECT_EQ(usb_->Pump(), sync::kNever);
}

TEST_F(Faulty, ADisconnectTakesEverythingAndLastsUntilClose) {
  Make({{.where = Where::kCompletion, .at = 1, .status = TransferStatus::kDisconnected}});
  ASSERT_TRUE(usb_->Open().ok());
  Transfer read;
  read.type = TransferType::kInterrupt;
  read.endpoint = 0x82;
  read.length = 64;
  const TransferId waiting = *usb_->Submit(std::move(read));
  ASSERT_TRUE(Read().ok());
  const std::vector<TransferCompletion> out = Drain();
  ASSERT_EQ(out.size(), 2u);
  EXPECT_EQ(out[0].status, TransferStatus::kDisconnected);
  EXPECT_EQ(out[1].id, waiting);
  EXPECT_EQ(out[1].status, TransferStatus::kDisconnected);
  EXPECT_EQ(out[1].endpoint, 0x82);
  EXPECT_TRUE(absl::IsUnavailable(Read().status()));
  usb_->Close();
  ASSERT_TRUE(usb_->Open().ok());
  ASSERT_TRUE(Read().ok());
  EXPECT_EQ(Drain()[0].status, TransferStatus::kOk);
}

TEST_F(Faulty, WakesByItself) {
  Make({{.where = Where::kCompletion, .at = 1, .hold = 50 * kMillisecond}}, true);
  sync::Mutex mutex;
  sync::CondVar changed;
  bool woken = false;
  ASSERT_TRUE(usb_->Open().ok());
  ASSERT_TRUE(Write().ok());
  pump_->Pump();
  std::vector<TransferCompletion> out;
  EXPECT_EQ(usb_->Drain(out), 0u);
  usb_->SetWake([&] {
    sync::MutexLock lock(mutex);
    woken = true;
    changed.NotifyAll();
  });
  clock_.Advance(50 * kMillisecond);
  {
    sync::MutexLock lock(mutex);
    while (!woken) changed.Wait(mutex);
  }
  EXPECT_EQ(usb_->Drain(out), 1u);
  usb_->SetWake(nullptr);
}

// ---- the driver over it

struct SweepCase {
  std::string name;
  TransportFault fault;
};
std::ostream& operator<<(std::ostream& out, const SweepCase& c) { return out << c.name; }

class DriverOverFaults : public testing::TestWithParam<SweepCase> {
 protected:
  // Runs an attach and five volumes with the fault at its n-th place; returns false if that place
  // was not reached.
  static bool RunWith(TransportFault fault) {
    sync::FakeClock clock;
    EmulatedCable cable(clock);
    auto made = std::make_unique<FaultyTransport>(std::move(cable.transport), std::vector{fault},
                                                  clock, FaultyTransport::Options{false});
    FaultyTransport& faulty = *made;
    TransportRig rig(std::move(made), clock,
                     {[pump = cable.pump] { return pump->Pump(); }, [&] { return faulty.Pump(); }});
    rig.Start();
    FrameSource source(rig.display().info().layout, 1);
    SliceFramePtr frame;
    for (int i = 0; i < 5; ++i) {
      frame = source.Next(i == 0 ? 1 : 0.3);
      rig.display().Submit(frame);
      EXPECT_TRUE(
          rig.RunUntil([&] { return rig.recorder().Of(frame->volume) != nullptr; }, 30 * kSecond))
          << "volume " << frame->volume << " has no outcome";
    }
    const std::vector<uint8_t> light = FrameToRgb(*frame);
    EXPECT_TRUE(rig.RunUntil(
        [&] {
          const auto seen = cable.device->Seen();
          return seen.has_value() && seen->Rgb() == light &&
                 rig.display().state() == DisplayState::kShowing;
        },
        30 * kSecond))
        << DisplayStateName(rig.display().state()) << ": " << rig.display().state_reason();
    const bool met = faulty.hits() > 0;
    rig.display().Stop();
    for (uint64_t volume = 1; volume <= frame->volume; ++volume) {
      EXPECT_EQ(rig.recorder().Count(volume), 1) << "outcomes of volume " << volume;
    }
    EXPECT_EQ(cable.device->credit_excess(), 0u);
    return met;
  }
};

TEST_P(DriverOverFaults, ComesBackWhereverOneFalls) {
  constexpr uint64_t kMost = 100'000;
  TransportFault fault = GetParam().fault;
  for (fault.at = 1; fault.at < kMost; ++fault.at) {
    SCOPED_TRACE(testing::Message() << "at " << fault.at);
    if (!RunWith(fault) || HasFailure()) break;
  }
  RecordProperty("places", static_cast<int>(fault.at));
  EXPECT_GT(fault.at, fault.where == Where::kOpen ? 1u : 20u);
  EXPECT_LT(fault.at, kMost);
}

SweepCase Refused(std::string name, Where where, absl::StatusCode code, uint64_t count = 1) {
  return {std::move(name),
          {.where = where, .count = count, .refusal = absl::Status(code, "planned")}};
}
SweepCase Says(std::string name, TransferStatus status, std::optional<uint32_t> actual = {}) {
  return {std::move(name),
          {.where = Where::kCompletion, .status = status, .actual_length = actual}};
}

INSTANTIATE_TEST_SUITE_P(
    Faults, DriverOverFaults,
    testing::Values(
        Refused("OpenNotFound", Where::kOpen, absl::StatusCode::kNotFound, 4),
        Refused("OpenDenied", Where::kOpen, absl::StatusCode::kPermissionDenied, 4),
        Refused("OpenUnavailable", Where::kOpen, absl::StatusCode::kUnavailable, 4),
        Refused("SubmitNoMemory", Where::kSubmit, absl::StatusCode::kResourceExhausted),
        Refused("SubmitNoMemoryLong", Where::kSubmit, absl::StatusCode::kResourceExhausted, 5),
        Refused("SubmitUnavailable", Where::kSubmit, absl::StatusCode::kUnavailable),
        Refused("SubmitInternal", Where::kSubmit, absl::StatusCode::kInternal, 3),
        Says("Stall", TransferStatus::kStall), Says("TimedOutNothing", TransferStatus::kTimedOut),
        Says("TimedOutHalf", TransferStatus::kTimedOut, 20),
        Says("TimedOutAll", TransferStatus::kTimedOut, 1u << 30),
        Says("Error", TransferStatus::kError), Says("Overflow", TransferStatus::kOverflow),
        Says("Short", TransferStatus::kShort, 5), Says("Empty", TransferStatus::kShort, 0),
        Says("Disconnected", TransferStatus::kDisconnected),
        Says("Cancelled", TransferStatus::kCancelled),
        SweepCase{"HeldAMoment", {.where = Where::kCompletion, .hold = 5 * kMillisecond}},
        SweepCase{"HeldLong", {.where = Where::kCompletion, .hold = 400 * kMillisecond}},
        SweepCase{"HeldVeryLong", {.where = Where::kCompletion, .hold = 5 * kSecond}}),
    [](const testing::TestParamInfo<SweepCase>& param) { return param.param.name; });

}  // namespace
}  // namespace voxeld::display
