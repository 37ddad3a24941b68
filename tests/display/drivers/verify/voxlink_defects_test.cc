// Tests voxlink's suite: devices that have one defect each, and the cases that must find it.
#include <string>

#include "display/drivers/voxlink/verify/suite.h"
#include "display/emulator/voxlink_device.h"
#include "gtest/gtest.h"
#include "tests/display/drivers/verify/planted.h"
#include "tests/display/drivers/verify/pump_waiter.h"

namespace voxeld::display::conformance {
namespace {

std::vector<Planted> UsbDefects() {
  return {
      {"SmallBulkPackets",
       {"usb.packet_sizes"},
       Descriptor(2, [](TransferStatus&, Bytes& data) { Store(data, 22, uint16_t{32}); }),
       {}},
      {"AnotherSubclass",
       {"usb.interface"},
       Descriptor(2, [](TransferStatus&, Bytes& data) { Store(data, 15, uint8_t{0x57}); }),
       {}},
      {"EventsOnAnotherEndpoint",
       {"usb.endpoints"},
       Descriptor(2, [](TransferStatus&, Bytes& data) { Store(data, 27, uint8_t{0x83}); }),
       {}},
      {"NoBos",
       {"usb.bos"},
       Descriptor(15,
                  [](TransferStatus& status, Bytes& data) {
                    status = TransferStatus::kStall;
                    data.clear();
                  }),
       {}},
      {"AnotherPlatform",
       {"usb.bos"},
       Descriptor(15,
                  [](TransferStatus&, Bytes& data) {
                    if (data.size() > 20) data[data.size() - 10] ^= std::byte{1};
                  }),
       {}},
      {"NoWinusb",
       {"usb.ms_descriptors"},
       {.answer =
            [](const UsbSetup& setup, TransferStatus&, Bytes& data) {
              if (setup.request_type == 0xC0 && data.size() > 20) data[14] = std::byte{'X'};
            }},
       {}},
      {"HaltIsNotTold",
       {"usb.halt_bulk", "usb.halt_interrupt"},
       {.answer =
            [](const UsbSetup& setup, TransferStatus&, Bytes& data) {
              if (setup.request_type == 0x82) Store(data, 0, uint16_t{0});
            }},
       {}},
      {"HaltIsNotCleared",
       {"usb.halt_bulk"},
       {.swallow =
            [](const UsbSetup& setup) { return setup.request_type == 0x02 && setup.request == 1; }},
       {}},
      {"ResetIsIgnored",
       {"usb.reset_ends_session", "usb.reset_forgets_settings"},
       {.reset_does_nothing = true},
       {}},
  };
}

std::vector<Planted> RequestDefects() {
  return {
      {"UnknownRequestsAnswered",
       {"requests.unknown"},
       Accepting(
           [](const UsbSetup& s) { return (s.request_type & 0x60) == 0x40 && s.request > 9; }),
       {}},
      {"AnyLengthTaken",
       {"requests.length"},
       Accepting([](const UsbSetup& s) { return Is(s, Request::kSetPowerLimit); }),
       {}},
      {"AnyBlankTaken",
       {"requests.value"},
       Accepting([](const UsbSetup& s) { return Is(s, Request::kSetBlank) && s.value > 1; }),
       {}},
      {"ModeTakenInSession",
       {"mode.in_session"},
       Accepting([](const UsbSetup& s) {
         return Is(s, Request::kSetMode) && s.length == 16 && s.value == 0;
       }),
       {}},
      {"PagesWithoutEnd",
       {"capabilities.pages"},
       Accepting([](const UsbSetup& s) { return Is(s, Request::kGetCapabilities); }),
       {}},
      {"WrongTotalLength",
       {"capabilities.pages", "capabilities.fields"},
       Capability([](auto& c) { c.total_length += 8; }),
       {}},
      {"WrongKeepalive",
       {"capabilities.fields"},
       Capability([](auto& c) { c.keepalive_ms = 50; }),
       {}},
      {"TwoVolumeBuffers",
       {"capabilities.fields"},
       Capability([](auto& c) { c.volume_buffers = 2; }),
       {}},
      {"ShortStatus",
       {"status.idle"},
       Reading(Request::kGetStatus, [](Bytes& data) { data.resize(76); }),
       {}},
      {"ModeWithoutRate",
       {"mode.round_trip"},
       Reading(Request::kGetMode, [](Bytes& data) { Store(data, 4, uint32_t{0}); }),
       {}},
      {"ModeIsForgotten",
       {"mode.round_trip"},
       Reading(Request::kGetMode, [](Bytes& data) { Store(data, 1, uint8_t{1}); }),
       {}},
      {"ClockInMicroseconds",
       {"status.clock"},
       StatusField([](auto& s) { s.time_ns /= 1000; }),
       {}},
      {"BytesNotCounted",
       {"status.session", "credit.exact"},
       StatusField([](auto& s) { s.bytes_received -= s.bytes_received % 64; }),
       {}},
      {"StatusWithoutShown", {"volume.whole"}, StatusField([](auto& s) { s.shown = 0; }), {}},
      {"BlankIsNotTold",
       {"light.blank", "light.blank_outlasts"},
       StatusField([](auto& s) { s.flags &= 0xFE; }),
       {}},
  };
}

std::vector<Planted> SessionDefects() {
  bool running = false;
  return {
      {"StopIsIgnored",
       {"session.stop", "status.idle"},
       {.swallow =
            [](const UsbSetup& s) {
              return Is(s, Request::kStop) && s.value == 0 && s.length == 0;
            }},
       {}},
      {"StartAgainIsIgnored",
       {"session.start_again"},
       {.swallow =
            [running](const UsbSetup& s) mutable {
              if (Is(s, Request::kStop)) running = false;
              return Is(s, Request::kStart) && s.value == 0 && s.index == 0 && s.length == 0 &&
                     std::exchange(running, true);
            }},
       {}},
      {"NoReady", {"session.ready"}, Silent(EventType::kReady), {}},
      {"ReadyWithAnotherBuffer",
       {"session.ready"},
       Events([](Bytes& e) {
         if (Is(e, EventType::kReady)) Store(e, kBody + 4, uint32_t{1});
         return true;
       }),
       {}},
      {"NumbersLeftOut",
       {"events.numbering"},
       Events([](Bytes& e) {
         const uint32_t n = At<uint32_t>(e, 4);
         Store(e, 4, n + n / 10);
         return true;
       }),
       {}},
      {"NumbersRepeated",
       {"events.numbering"},
       Events([](Bytes& e) {
         Store(e, 4, At<uint32_t>(e, 4) / 2);
         return true;
       }),
       {}},
      {"WrongEventLength",
       {"session.ready", "volume.whole"},
       Events([](Bytes& e) {
         Store(e, 2, uint16_t{64});
         return true;
       }),
       {}},
      {"ClockGoesBack",
       {"events.sweeps"},
       Events([](Bytes& e) {
         if (Is(e, EventType::kSweep)) Store(e, 8, At<uint64_t>(e, 8) / 2);
         return true;
       }),
       {}},
      {"CreditFalls",
       {"credit.told"},
       Events([](Bytes& e) {
         if (At<uint32_t>(e, 4) % 5 == 4) Store(e, 16, uint64_t{32768});
         return true;
       }),
       {}},
      {"TooMuchCredit",
       {"session.ready", "volume.whole"},
       Events([](Bytes& e) {
         Store(e, 16, At<uint64_t>(e, 16) + (1u << 20));
         return true;
       }),
       {}},
      {"CreditIsNotTold",
       {"credit.told"},
       Events([](Bytes& e) {
         Store(e, 16, uint64_t{32768});
         return true;
       }),
       {}},
      {"NoHealth", {"events.health"}, Silent(EventType::kHealth), {}},
      {"NoSweeps", {"events.sweeps", "events.shown"}, Silent(EventType::kSweep), {}},
      {"SweepsAtAnotherRate",
       {"events.sweeps"},
       Events([](Bytes& e) {
         if (Is(e, EventType::kSweep)) Store(e, kBody + 8, At<uint64_t>(e, kBody + 8) / 2);
         return true;
       }),
       {}},
      {"NoUnderruns", {"events.underrun"}, Silent(EventType::kUnderrun), {}},
  };
}

std::vector<Planted> PacketDefects() {
  return {
      {"SingleBytesLost",
       {"stream.single_bytes"},
       {.bulk =
            [n = 0](Bytes& bytes) mutable {
              if (bytes.size() == 1 && ++n % 50 == 0) bytes.clear();
            }},
       {}},
      {"OddTransfersPadded",
       {"stream.odd_sizes"},
       {.bulk =
            [](Bytes& bytes) {
              if (bytes.size() % 2 == 1 && bytes.size() > 1) bytes.push_back(std::byte{0});
            }},
       {}},
      {"EmptyTransfersStall",
       {"stream.zero_length"},
       {.bulk_end =
            [](size_t size, TransferStatus& status) {
              if (size == 0) status = TransferStatus::kStall;
            }},
       {}},
      {"NoErrors",
       {"damage.noise", "damage.payload_crc", "damage.sequence", "slice.outside"},
       Silent(EventType::kError),
       {}},
      {"SkippedBytesMiscounted",
       {"damage.noise", "damage.header_crc"},
       Events([](Bytes& e) {
         if (Is(e, EventType::kError) && At<uint32_t>(e, kBody) == 1) {
           Store(e, kBody + 20, At<uint32_t>(e, kBody + 20) + 1);
         }
         return true;
       }),
       {}},
      {"BadHeadersTaken",
       {"damage.header_crc"},
       Packets([](PacketHeader&, std::span<std::byte>) {}),
       {}},
      {"SequenceUnchecked",
       {"damage.sequence"},
       Packets([next = uint32_t{0}](PacketHeader& h, std::span<std::byte>) mutable {
         if (h.sequence == 0) next = 0;
         h.sequence = next++;
       }),
       {}},
      {"AnotherReason",
       {"begin.wrong_base"},
       Events([](Bytes& e) {
         if (Is(e, EventType::kAborted) && At<uint32_t>(e, kBody + 8) == 3)
           Store(e, kBody + 8, uint32_t{4});
         return true;
       }),
       {}},
      {"AnyBaseTaken",
       {"begin.wrong_base", "begin.no_base", "session.start_again"},
       Packets([](PacketHeader& h, std::span<std::byte> payload) {
         if (h.type != 1 || payload.size() <= 16) return;
         const uint64_t none = 0;  // as if every picture followed, but none does
         std::memcpy(payload.data(), &none, 8);
       }),
       {}},
      {"IncompleteIsComplete",
       {"volume.missing", "volume.incomplete", "damage.payload_crc"},
       Events([](Bytes& e) {
         if (Is(e, EventType::kMissing)) Store(e, 0, uint8_t{4});
         return true;
       }),
       {}},
      {"MissingWithoutLast",
       {"volume.missing"},
       Events([](Bytes& e) {
         if (Is(e, EventType::kMissing)) Store(e, 1, uint8_t{0});
         return true;
       }),
       {}},
      {"MissingTooFew",
       {"volume.missing"},
       Events([](Bytes& e) {
         const uint32_t runs = At<uint32_t>(e, kBody + 8);
         if (Is(e, EventType::kMissing) && runs > 1) Store(e, kBody + 8, runs - 1);
         return true;
       }),
       {}},
      {"AnotherVolumeShown",
       {"volume.whole"},
       Events([](Bytes& e) {
         if (Is(e, EventType::kShown)) Store(e, kBody, At<uint64_t>(e, kBody) + 1);
         return true;
       }),
       {}},
      {"NeverShown", {"volume.whole"}, Silent(EventType::kShown), {}},
      {"ShownBetweenSweeps",
       {"events.shown"},
       Events([](Bytes& e) {
         if (Is(e, EventType::kShown))
           Store(e, kBody + 16, At<uint64_t>(e, kBody + 16) + 20'000'000);
         return true;
       }),
       {}},
      {"EndUnansweredOnceComplete",
       {"end.repeated"},
       Events([last = uint64_t{0}](Bytes& e) mutable {
         if (Is(e, EventType::kReady)) last = 0;
         return !Is(e, EventType::kComplete) ||
                std::exchange(last, At<uint64_t>(e, kBody)) != At<uint64_t>(e, kBody);
       }),
       {}},
      {"HoldIsIgnored",
       {"hold.show"},
       Packets([](PacketHeader& h, std::span<std::byte>) {
         if (h.type == 3) h.flags |= 1;
       }),
       {}},
      {"SweepOfShowIsIgnored",
       {"hold.show_at"},
       Packets([](PacketHeader& h, std::span<std::byte> payload) {
         if (h.type == 5) std::fill(payload.begin(), payload.end(), std::byte{0});
       }),
       {}},
      {"LateOrdersAreTaken",
       {"hold.ahead"},
       Packets([](PacketHeader& h, std::span<std::byte> payload) {
         if (h.type == 5 && payload.size() == 16) std::fill_n(payload.begin() + 8, 4, std::byte{0});
       }),
       {}},
      {"OrdersUnanswered", {"hold.ahead"}, Silent(EventType::kOrdered), {}},
      {"AbortUnanswered",
       {"abort.filling"},
       Events(
           [](Bytes& e) { return !Is(e, EventType::kAborted) || At<uint32_t>(e, kBody + 8) != 1; }),
       {}},
      {"ReplacedInSilence",
       {"hold.replaced"},
       Events(
           [](Bytes& e) { return !Is(e, EventType::kDropped) || At<uint32_t>(e, kBody + 8) != 2; }),
       {}},
      {"DropIsIgnored",
       {"hold.drop"},
       Packets([](PacketHeader& h, std::span<std::byte>) {
         if (h.type == 6) h.type = 7;
       }),
       {}},
      {"AllIsAnnounced",
       {"begin.delta_missing", "slice.not_announced"},
       Packets([](PacketHeader& h, std::span<std::byte> payload) {
         if (h.type == 1 && payload.size() > 16) payload[16] |= std::byte{0x0F};
       }),
       {}},
  };
}

std::vector<Planted> LightDefects() {
  return {
      {"NoWatchdogThoughSaid",
       {"watchdog.silence"},
       Capability([](auto& c) {
         c.features |= voxlink::kFeatureWatchdog;
         c.watchdog_ms = 250;
       }),
       [](VoxlinkDeviceConfig& config) { config.watchdog = false; }},
      {"WatchdogThoughDenied",
       {"watchdog.none"},
       Capability([](auto& c) {
         c.features &= ~uint32_t{voxlink::kFeatureWatchdog};
         c.watchdog_ms = 0;
       }),
       {}},
      {"KeepalivesUnheard",
       {"watchdog.keepalive"},
       // Removed from the stream: neither processed nor reported missing.
       {.bulk =
            [](Bytes& bytes) {
              if (bytes.size() == 40 && At<uint8_t>(bytes, 4) == 7) bytes.assign(40, std::byte{0});
            }},
       {}},
      {"BlankEndsWithTheSession",
       {"light.blank_outlasts"},
       StatusField([](auto& s) {
         if (s.running == 0) s.flags = 0;
       }),
       {}},
      {"LightUntold", {"light.blank", "watchdog.silence"}, Silent(EventType::kLight), {}},
      {"ShownNotDark",
       {"light.blank"},
       Events([](Bytes& e) {
         if (Is(e, EventType::kShown)) Store(e, 1, uint8_t{0});
         return true;
       }),
       {}},
  };
}

std::vector<Planted> VoxlinkDefects() {
  std::vector<Planted> all;
  for (auto* const list :
       {&UsbDefects, &RequestDefects, &SessionDefects, &PacketDefects, &LightDefects}) {
    const std::vector<Planted> some = list();
    all.insert(all.end(), some.begin(), some.end());
  }
  return all;
}

class VoxlinkDefect : public testing::TestWithParam<Planted> {};

TEST_P(VoxlinkDefect, IsFound) {
  const Planted& planted = GetParam();
  PlanarStack planar;
  planar.width_px = 8;
  planar.height_px = 6;
  for (int i = 0; i < 20; ++i) planar.positions_mm.push_back(i);
  VoxlinkDeviceConfig config;
  config.geometry.shape = planar;
  config.speed = UsbSpeed::kHigh;
  config.receive_buffer = 32768;
  config.max_payload = 4096;
  if (planted.config) planted.config(config);
  sync::FakeClock clock;
  Rig rig(std::make_unique<DefectiveDevice>(
              std::make_unique<emulator::VoxlinkDevice>(config, clock), planted.defect),
          clock, voxlink::MakeSuite(nullptr));
  const absl::StatusOr<RunResult> run = rig.Run();
  ASSERT_TRUE(run.ok()) << run.status();
  const std::set<std::string> failed = FailedIds(*run);
  for (const std::string& id : planted.found_by) {
    EXPECT_TRUE(failed.contains(id)) << id << " does not find it; those that do:" << Failures(*run);
  }
  for (const CaseResult& result : run->results) {
    if (result.verdict.kind != Verdict::Kind::kFailed) continue;
    EXPECT_NE(result.verdict.expected, "") << result.what->id;
    EXPECT_NE(result.verdict.seen, "") << result.what->id;
  }
}

INSTANTIATE_TEST_SUITE_P(Verify, VoxlinkDefect, testing::ValuesIn(VoxlinkDefects()),
                         [](const auto& info) { return info.param.name; });

}  // namespace
}  // namespace voxeld::display::conformance
