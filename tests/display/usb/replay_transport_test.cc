// Tests recordings of the voxlink driver that are replayed to a fresh one, without a device: it
// acts and reports the same. Differences are named; damaged recordings do no harm.

#include "display/usb/replay_transport.h"

#include <cstring>
#include <fstream>
#include <random>
#include <string>
#include <vector>

#include "display/usb/recording_transport.h"
#include "gtest/gtest.h"
#include "tests/display/usb/transport_rig.h"

namespace voxeld::display {
namespace replay_transport_test {

using sync::kMillisecond;
using sync::kSecond;

using Bytes = std::vector<std::byte>;

// The actions of a test on a display and its cable.
using Deeds = std::function<void(TransportRig&, const std::function<void(bool)>& set_plugged)>;

// The reports of a display.
struct Told {
  std::vector<std::string> outcomes;
  std::vector<std::pair<DisplayState, std::string>> states;
  bool operator==(const Told&) const = default;
};

Told Heard(TransportRig& rig) {
  Told told;
  for (const VolumeOutcome& outcome : rig.recorder().outcomes) {
    told.outcomes.push_back(testing::PrintToString(
        std::tuple(outcome.volume, static_cast<int>(outcome.kind), outcome.replaced_by,
                   outcome.reason, outcome.time_ns, outcome.bytes_sent, outcome.last_byte_ns)));
  }
  told.states = rig.recorder().states;
  return told;
}

void ShowVolumes(TransportRig& rig, int count) {
  FrameSource source(rig.display().info().layout, 1);
  for (int i = 0; i < count; ++i) {
    const SliceFramePtr frame = source.Next(i == 0 ? 1 : 0.3);
    rig.display().Submit(frame);
    ASSERT_TRUE(rig.RunUntil([&] { return rig.recorder().Of(frame->volume) != nullptr; }));
  }
}

void ShowFive(TransportRig& rig, const std::function<void(bool)>& /*set_plugged*/) {
  ShowVolumes(rig, 5);
  rig.RunFor(300 * kMillisecond);  // keepalives
}

struct Recorded {
  Bytes file;
  Told told;
};

Recorded Record(const Deeds& deeds) {
  Recorded recorded;
  MemoryRecording recording;
  {
    sync::FakeClock clock;
    EmulatedCable cable(clock);
    TransportRig rig(
        std::make_unique<RecordingTransport>(std::move(cable.transport), recording.MakeRecorder(),
                                             clock, RecordingTransport::Options{}),
        clock, {[pump = cable.pump] { return pump->Pump(); }});
    rig.Start();
    deeds(rig, [&](bool plugged) {
      cable.pump->WithDevice([&](UsbDeviceModel& device) { device.SetPlugged(plugged); });
    });
    rig.display().Stop();
    recorded.told = Heard(rig);
  }
  recorded.file = recording.bytes();
  return recorded;
}

struct Replayed {
  Told told;
  absl::Status status;
  bool finished = false;
};

absl::StatusOr<Replayed> Replay(const Bytes& file, const Deeds& deeds, bool at_once = false) {
  sync::FakeClock clock;
  auto transport = ReplayTransport::Make(file, clock, {.own_thread = false, .at_once = at_once});
  if (!transport.ok()) return transport.status();
  ReplayTransport& replay = **transport;
  TransportRig rig(*std::move(transport), clock, {[&] { return replay.Pump(); }});
  rig.Start();
  deeds(rig, [](bool) {});
  rig.display().Stop();
  return Replayed{Heard(rig), replay.status(), replay.finished()};
}

TEST(Replay, ADriverToldTheSameDoesTheSame) {
  const Recorded recorded = Record(ShowFive);
  ASSERT_EQ(recorded.told.outcomes.size(), 5u);
  const auto replayed = Replay(recorded.file, ShowFive);
  ASSERT_TRUE(replayed.ok()) << replayed.status();
  EXPECT_TRUE(replayed->status.ok()) << replayed->status;
  EXPECT_TRUE(replayed->finished);
  EXPECT_EQ(replayed->told.outcomes, recorded.told.outcomes);
  EXPECT_EQ(replayed->told.states, recorded.told.states);
}

TEST(Replay, SessionsFollowEachOtherAsTheyDid) {
  const Deeds deeds = [](TransportRig& rig, const std::function<void(bool)>& set_plugged) {
    ShowVolumes(rig, 2);
    set_plugged(false);
    rig.RunFor(700 * kMillisecond);
    set_plugged(true);
    rig.RunFor(kSecond);
  };
  const Recorded recorded = Record(deeds);
  ASSERT_GE(recorded.told.states.size(), 4u);  // showing, lost, attaching, showing
  const auto replayed = Replay(recorded.file, deeds);
  ASSERT_TRUE(replayed.ok()) << replayed.status();
  EXPECT_TRUE(replayed->status.ok()) << replayed->status;
  EXPECT_TRUE(replayed->finished);
  EXPECT_EQ(replayed->told.outcomes, recorded.told.outcomes);
  EXPECT_EQ(replayed->told.states, recorded.told.states);
}

TEST(Replay, AtOnceNothingWaitsForItsTime) {
  const Deeds deeds = [](TransportRig& rig, const std::function<void(bool)>&) {
    ShowVolumes(rig, 5);
  };
  const Recorded recorded = Record(deeds);
  sync::FakeClock clock;
  auto transport =
      ReplayTransport::Make(recorded.file, clock, {.own_thread = false, .at_once = true});
  ASSERT_TRUE(transport.ok()) << transport.status();
  ReplayTransport& replay = **transport;
  TransportRig rig(*std::move(transport), clock, {[&] { return replay.Pump(); }});
  rig.Start();
  const sync::TimeNs begin = clock.Now();
  ShowVolumes(rig, 5);
  EXPECT_EQ(clock.Now(), begin);
  rig.display().Stop();
  EXPECT_TRUE(replay.status().ok()) << replay.status();
  EXPECT_TRUE(replay.finished());
}

TEST(Replay, OnItsOwnThreadToo) {
  const Recorded recorded = Record([](TransportRig&, const std::function<void(bool)>&) {});
  sync::SystemClock clock;
  sync::Mutex mutex;
  sync::CondVar woken;
  bool wake = false;
  auto replay = ReplayTransport::Make(recorded.file, clock, {.at_once = true});
  ASSERT_TRUE(replay.ok()) << replay.status();
  (*replay)->SetWake([&] {
    sync::MutexLock lock(mutex);
    wake = true;
    woken.NotifyAll();
  });
  ASSERT_TRUE((*replay)->Open().ok());
  EXPECT_FALSE((*replay)->Open().ok());
  Transfer read;
  read.type = TransferType::kControl;
  read.setup = {.request_type = 0x80, .request = 6, .value = 0x0200, .length = 1024};
  read.length = 1024;
  ASSERT_TRUE((*replay)->Submit(std::move(read)).ok());
  {
    sync::MutexLock lock(mutex);
    while (!wake) woken.Wait(mutex);
  }
  std::vector<TransferCompletion> out;
  ASSERT_EQ((*replay)->Drain(out), 1u);
  EXPECT_EQ(out[0].status, TransferStatus::kShort);
  EXPECT_EQ(out[0].data.size(), out[0].actual_length);
  EXPECT_EQ((*replay)->bytes_in_flight(), 0u);
  (*replay)->SetWake(nullptr);
}

TEST(Replay, WhatTheDriverDoesOtherwiseIsNamed) {
  const Recorded recorded = Record(ShowFive);
  // Another first volume, whose first slice differs.
  std::string reason;
  const auto replayed =
      Replay(recorded.file, [&](TransportRig& rig, const std::function<void(bool)>&) {
        FrameSource source(rig.display().info().layout, 2);
        rig.display().Submit(source.Next(1));
        rig.RunFor(kSecond);
        EXPECT_EQ(rig.display().state(), DisplayState::kLost);
        EXPECT_EQ(rig.recorder().outcomes.size(), 1u);
        reason = rig.display().state_reason();
      });
  ASSERT_TRUE(replayed.ok());
  EXPECT_FALSE(replayed->finished);
  const std::string message(replayed->status.message());
  EXPECT_TRUE(message.starts_with("packet ")) << message;
  // The CRC of the first slice's payload: after BEGIN's 56 bytes, at 32 of the header.
  EXPECT_NE(message.find(" of the recording, bulk OUT 0x01: byte 88 is 0x"), std::string::npos)
      << message;
  EXPECT_EQ(reason, message);
}

class Mismatch : public testing::Test {
 protected:
  Mismatch()
      : file_(Record([](TransportRig& rig, const std::function<void(bool)>&) {
                ShowVolumes(rig, 1);
              }).file) {}
  std::string ErrorOf(Transfer transfer) {
    auto replay = ReplayTransport::Make(file_, clock_, {.own_thread = false});
    EXPECT_TRUE(replay.ok() && (*replay)->Open().ok());
    const absl::Status status = (*replay)->Submit(std::move(transfer)).status();
    EXPECT_EQ((*replay)->status(), status);
    EXPECT_EQ((*replay)->Open().code(), absl::StatusCode::kFailedPrecondition);
    (*replay)->Close();
    EXPECT_EQ((*replay)->Open(), status);
    return std::string(status.message());
  }
  sync::FakeClock clock_;
  Bytes file_;
};

TEST_F(Mismatch, OfEachKindSaysWhatIsExpected) {
  Transfer transfer;
  transfer.type = TransferType::kControl;
  transfer.setup = {.request_type = 0x80, .request = 6, .value = 0x0100, .length = 1024};
  transfer.length = 1024;
  EXPECT_EQ(ErrorOf(transfer),
            "packet 1 of the recording, control: setup byte 3 is 0x01; recorded is 0x02");
  transfer.setup.value = 0x0200;
  transfer.length = 9;
  EXPECT_EQ(ErrorOf(transfer),
            "packet 1 of the recording, control: it asks for 9 bytes; recorded are 1024");
  Transfer bulk;
  bulk.endpoint = 0x01;
  bulk.data.resize(3);
  bulk.data[0] = std::byte{0x56};
  bulk.data[1] = std::byte{0x58};
  const std::string differs = ErrorOf(bulk);
  EXPECT_TRUE(differs.ends_with(", bulk OUT 0x01: byte 2 is 0x00; recorded is 0x4c")) << differs;
  bulk.data.resize(2);
  const std::string shorter = ErrorOf(bulk);
  EXPECT_TRUE(shorter.find("it has 2 bytes; recorded are ") != std::string::npos) << shorter;
  EXPECT_TRUE(shorter.ends_with("they agree up to byte 2")) << shorter;
  bulk.type = TransferType::kInterrupt;
  const std::string type = ErrorOf(bulk);
  EXPECT_TRUE(type.ends_with("bulk OUT 0x01: the transfer is interrupt OUT 0x01")) << type;
}

TEST(Replay, EndsUnplugged) {
  // A recording that stops in the middle of a session, at the end of a packet.
  const Recorded recorded = Record(ShowFive);
  size_t end = 0, packets = 0;
  while (packets < 60) {
    uint32_t type, length;
    std::memcpy(&type, recorded.file.data() + end, 4);
    std::memcpy(&length, recorded.file.data() + end + 4, 4);
    packets += type == 6 ? 1 : 0;
    end += length;
  }
  const Bytes half(recorded.file.begin(), recorded.file.begin() + static_cast<ptrdiff_t>(end));
  const auto replayed = Replay(half, [](TransportRig& rig, const std::function<void(bool)>&) {
    FrameSource source(rig.display().info().layout, 1);
    for (int i = 0; i < 5; ++i) {
      rig.display().Submit(source.Next(i == 0 ? 1 : 0.3));
      rig.RunFor(100 * kMillisecond);
    }
    rig.RunFor(10 * kSecond);
    EXPECT_EQ(rig.display().state(), DisplayState::kLost);
  });
  ASSERT_TRUE(replayed.ok()) << replayed.status();
}

TEST(Replay, IncompleteRecordingsAreRefused) {
  sync::FakeClock clock;
  const auto error_of = [&](const std::vector<UsbPacket>& packets) {
    Bytes file;
    AppendRecordingStart({}, file);
    for (const UsbPacket& packet : packets) AppendUsbPacket(packet, file);
    return std::string(
        ReplayTransport::Make(file, clock, {.own_thread = false}).status().message());
  };
  UsbPacket packet;
  packet.header = {.id = 5, .type = 'S', .xfer_type = UsbmonHeader::kInterrupt, .epnum = 0x82};
  packet.header.length = 64;
  EXPECT_EQ(error_of({}), "the recording has no packets");
  EXPECT_EQ(error_of({packet}), "");
  EXPECT_EQ(error_of({packet, packet}),
            "recording, packet 2: transfer 5 is submitted, which is in flight");
  UsbPacket end = packet;
  end.header.type = 'C';
  end.header.length = 3;
  EXPECT_EQ(error_of({end}),
            "recording, packet 1: transfer 5 ends, which was not submitted on this device address");
  EXPECT_EQ(error_of({packet, end}),
            "recording, packet 2: 3 bytes came in, but it holds only 0 of them");
  end.header.length = 65;
  EXPECT_EQ(error_of({packet, end}),
            "recording, packet 2: 65 bytes came in, but only 64 were asked for");
  end.left_out_before = 4;
  EXPECT_EQ(error_of({packet, end}),
            "recording, packet 2: before it 4 packets were left out; only a whole recording can be "
            "used");
  packet.header.xfer_type = 0;
  EXPECT_EQ(error_of({packet}),
            "recording, packet 1: a transfer of type 0; only interrupt (1), control (2) and bulk "
            "(3) are known");
  packet.header.type = 'X';
  EXPECT_EQ(error_of({packet}),
            "recording, packet 1: its type is 88; it must be 'S' (83), 'C' (67) or 'E' (69)");
  const auto missing = ReplayTransport::FromFile("/nonexistent.pcapng", clock, {});
  EXPECT_TRUE(absl::IsNotFound(missing.status())) << missing.status();
}

TEST(Replay, FromAFile) {
  const Recorded recorded = Record(ShowFive);
  const std::string path = testing::TempDir() + "voxeld_replay.pcapng";
  std::ofstream(path, std::ios::binary)
      .write(reinterpret_cast<const char*>(recorded.file.data()),
             static_cast<std::streamsize>(recorded.file.size()));
  sync::FakeClock clock;
  EXPECT_TRUE(ReplayTransport::FromFile(path, clock, {}).ok());
  EXPECT_TRUE(absl::IsResourceExhausted(ReplayTransport::FromFile(path, clock, {}, 100).status()));
  std::remove(path.c_str());
}

// The driver and the replay survive.
TEST(Replay, DamagedRecordingsDoNoHarm) {
  const Deeds deeds = [](TransportRig& rig, const std::function<void(bool)>&) {
    FrameSource source(rig.display().info().layout, 1);
    rig.display().Submit(source.Next(1));
    rig.RunFor(300 * kMillisecond);
  };
  const Bytes file = Record(deeds).file;
  int played = 0;
  for (size_t size = 0; size < file.size(); ++size) {
    const Bytes cut(file.begin(), file.begin() + static_cast<ptrdiff_t>(size));
    played += Replay(cut, deeds).ok() ? 1 : 0;
  }
  EXPECT_GT(played, 10);
  std::mt19937 random(1);
  played = 0;
  for (int i = 0; i < 3000; ++i) {
    Bytes damaged = file;
    for (uint32_t n = 1 + random() % 4; n > 0; --n) {
      damaged[random() % damaged.size()] ^= static_cast<std::byte>(1 << random() % 8);
    }
    played += Replay(damaged, deeds, i % 2 == 0).ok() ? 1 : 0;
  }
  EXPECT_GT(played, 100);
}

}  // namespace replay_transport_test
}  // namespace voxeld::display
