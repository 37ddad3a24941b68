// Tests the C99 device: the bytes on the protocol's page, the suite that checks devices against the
// protocol, and the real driver over a good and over a bad cable.
#include <algorithm>
#include <array>
#include <cstring>
#include <functional>
#include <map>
#include <memory>
#include <ostream>
#include <random>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <tuple>
#include <variant>
#include <vector>

#include "display/crc/crc32c.h"
#include "display/drivers/simulated/emulated_device.h"
#include "display/drivers/voxlink/protocol.h"
#include "display/drivers/voxlink/verify/suite.h"
#include "display/drivers/voxlink/voxlink_display.h"
#include "display/emulator/fault_injector.h"
#include "gtest/gtest.h"
#include "tests/display/drivers/firmware/firmware_device.h"
#include "tests/display/drivers/rig.h"
#include "tests/display/drivers/verify/pump_waiter.h"

namespace voxeld::display {
namespace {

using sync::kMillisecond;
using sync::kSecond;
using Options = std::map<std::string, std::string>;

simulated::EmulatedDevice Emulated(Options options) {
  const DisplayOptions all{
      .name = "firmware", .driver = "simulated", .options = std::move(options)};
  absl::StatusOr<simulated::EmulatedDevice> read = simulated::ReadEmulatedDevice(all);
  EXPECT_TRUE(read.ok()) << read.status();
  return *std::move(read);
}

std::unique_ptr<FirmwareDevice> Make(const emulator::VoxlinkDeviceConfig& config,
                                     sync::Clock& clock) {
  const uint32_t rate = static_cast<uint32_t>(config.volumes_per_second * 1000);
  const bool watchdog = config.watchdog;
  const int32_t height =
      std::visit([](const auto& shape) { return shape.height_px; }, config.geometry.shape);
  const auto formats =
      static_cast<uint8_t>(height % 2 == 0 ? 0x1F : 0x17);  // HUB75 has pairs of rows
  voxlink::DeviceCapabilities capabilities{
      .fixed = {.version = 0x0100,
                .formats = formats,
                .max_sub_frames = config.max_sub_frames,
                .features = (watchdog ? 1u : 0u) | 2u | 4u | 8u | 16u,
                .receive_buffer = config.receive_buffer,
                .max_payload = config.max_payload,
                .volume_buffers = 3,
                .min_rate_mhz = rate / 4,
                .max_rate_mhz = rate,
                .nominal_rate_mhz = rate,
                .keepalive_ms = 100,
                .watchdog_ms = static_cast<uint16_t>(watchdog ? 250 : 0)},
      .geometry = config.geometry};
  return std::make_unique<FirmwareDevice>(capabilities, config.speed, clock);
}

// ---- §12 of the protocol's page

std::vector<uint8_t> FromHex(std::string_view hex) {
  std::vector<uint8_t> bytes;
  std::string digits;
  for (const char c : hex) {
    if (c == ' ') continue;
    digits += c;
    if (digits.size() < 2) continue;
    bytes.push_back(static_cast<uint8_t>(std::stoi(digits, nullptr, 16)));
    digits.clear();
  }
  return bytes;
}

TEST(Firmware, AnswersThePagesExampleWithThePagesBytes) {
  const std::vector<uint8_t> capabilities = FromHex(
      "70 00 00 00 00 01 01 01 01 00 00 00 00 00 01 00 00 04 00 00 02 00 00 00 02 00 00 00 01 00 "
      "00 00 03 00 00 00 30 75 00 00 30 75 00 00 30 75 00 00 00 00 00 00 64 00 FA 00 00 00 00 00 "
      "00 00 00 00");
  uint8_t volumes[3 * 12], payload[1024];
  uint32_t filled[2];
  const voxlink_memory memory = {capabilities.data(), volumes, 12, filled, 2, payload};
  voxlink_device device;
  ASSERT_TRUE(voxlink_init(&device, &memory));
  const uint8_t* answer = nullptr;
  ASSERT_EQ(voxlink_request(&device, 0, 0x41, 0x05, 0, 0, nullptr, 0, &answer), 0);
  uint8_t event[64];
  ASSERT_EQ(voxlink_event(&device, 0, event), 32u);
  EXPECT_EQ(event[0], 1);  // READY
  const std::vector<uint8_t> volume = FromHex(
      "56 58 4C 4B 01 00 00 00 01 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 10 00 "
      "00 00 A4 60 08 D0 58 27 B6 4E 00 00 00 00 00 00 00 00 02 00 00 00 00 00 00 00"
      "56 58 4C 4B 02 00 00 00 01 00 00 00 00 00 00 00 01 00 00 00 00 00 00 00 00 00 00 00 06 00 "
      "00 00 35 76 72 45 D2 46 CE 6D FF 00 00 00 FF 00"
      "56 58 4C 4B 02 00 00 00 01 00 00 00 00 00 00 00 02 00 00 00 01 00 00 00 00 00 00 00 06 00 "
      "00 00 B2 C8 B2 E0 56 86 E9 ED 00 00 FF FF FF FF"
      "56 58 4C 4B 03 01 00 00 01 00 00 00 00 00 00 00 03 00 00 00 00 00 00 00 00 00 00 00 00 00 "
      "00 00 00 00 00 00 A9 42 AF 06");
  ASSERT_EQ(volume.size(), 188u);
  for (const uint8_t byte : volume) voxlink_bulk(&device, 5'000'000, &byte, 1);
  ASSERT_EQ(voxlink_event(&device, 5'000'000, event), 32u);
  EXPECT_EQ(std::vector<uint8_t>(event, event + 32),
            FromHex("04 00 20 00 01 00 00 00 40 4B 4C 00 00 00 00 00 BC 00 01 00 00 00 00 00 01 00 "
                    "00 00 00 00 00 00"));
  EXPECT_EQ(voxlink_light(&device), nullptr);
  voxlink_sweep(&device, 33'333'333);
  const uint8_t* const light = voxlink_light(&device);
  ASSERT_NE(light, nullptr);
  EXPECT_EQ(std::vector<uint8_t>(light, light + 12), FromHex("FF0000 00FF00 0000FF FFFFFF"));
}

// The stack around the device behaves like the emulator: if a read has no room for an event, it
// overflows.
TEST(Firmware, AnEventThatItsReadHasNoRoomForOverflows) {
  sync::FakeClock clock;
  const auto device = Make(Emulated({{"size", "1x1x1"}}).config, clock);
  std::vector<std::tuple<uint64_t, TransferStatus, uint32_t, size_t>> done;
  device->SetComplete(
      [&](uint64_t id, TransferStatus status, uint32_t actual, std::span<const std::byte> in) {
        done.emplace_back(id, status, actual, in.size());
      });
  const auto read = [&](uint64_t id, uint32_t room) {
    Urb urb;
    urb.id = id;
    urb.endpoint = voxlink::kInterruptIn;
    urb.length = room;
    device->Submit(urb);
  };
  const auto start = [&](uint64_t id) {
    Urb urb;
    urb.id = id;
    urb.setup = {.request_type = voxlink::kRequestOut,
                 .request = static_cast<uint8_t>(voxlink::Request::kStart)};
    device->Submit(urb);
  };
  // READY has 32 bytes.
  for (const auto& [room, status, size] :
       {std::tuple{5u, TransferStatus::kOverflow, 5u},
        std::tuple{31u, TransferStatus::kOverflow, 31u}, std::tuple{32u, TransferStatus::kOk, 32u},
        std::tuple{64u, TransferStatus::kShort, 32u}}) {
    done.clear();
    start(1);
    read(2, room);
    ASSERT_EQ(done.size(), 2u) << room;
    EXPECT_EQ(done[0], std::tuple(uint64_t{1}, TransferStatus::kOk, 0u, size_t{0}));
    EXPECT_EQ(done[1], std::tuple(uint64_t{2}, status, size, size_t{size}));
  }
}

// ---- a malicious host

// Returns a packet whose CRCs are right, whatever its content.
std::vector<uint8_t> Packet(voxlink::PacketHeader header, std::span<const std::byte> payload) {
  header.magic = voxlink::kMagic;
  header.length = static_cast<uint32_t>(payload.size());
  header.payload_crc = payload.empty() ? 0 : Crc32c(payload);
  const std::span<const std::byte> head = std::as_bytes(std::span(&header, 1));
  header.header_crc = Crc32c(head.first(voxlink::kHeaderCrcOffset));
  std::vector<std::byte> bytes(head.begin(), head.end());
  bytes.insert(bytes.end(), payload.begin(), payload.end());
  std::vector<uint8_t> out(bytes.size());
  std::memcpy(out.data(), bytes.data(), bytes.size());
  return out;
}

TEST(Firmware, NothingThatAHostSendsLeavesItsMemory) {
  // The capabilities of the page's example, with two rows and 64 sub-frames: at most 128 pictures
  // of 12 bytes.
  std::vector<uint8_t> capabilities = FromHex(
      "70 00 00 00 00 01 1F 40 1F 00 00 00 00 00 01 00 00 04 00 00 02 00 00 00 02 00 00 00 02 00 "
      "00 00 03 00 00 00 30 75 00 00 30 75 00 00 30 75 00 00 00 00 00 00 64 00 FA 00 00 00 00 00 "
      "00 00 00 00");
  capabilities.resize(0x70);
  constexpr size_t kVolume = 128 * 12, kGuard = 64;
  struct {
    uint8_t before[kGuard], volumes[3 * kVolume], between[kGuard], payload[1024], behind[kGuard];
    uint32_t filled[128], last[kGuard];
  } memory;
  std::memset(&memory, 0xA5, sizeof(memory));
  const voxlink_memory given = {capabilities.data(), memory.volumes, kVolume, memory.filled, 128,
                                memory.payload};
  auto device = std::make_unique<voxlink_device>();
  ASSERT_TRUE(voxlink_init(device.get(), &given));
  std::mt19937 random(3);
  const auto below = [&](uint32_t n) { return static_cast<uint32_t>(random() % n); };
  const uint8_t* answer = nullptr;
  uint8_t event[64];
  uint64_t now = 0, events = 0, lit = 0;
  uint32_t sequence = 0;
  for (int i = 0; i < 200'000; ++i) {
    now += below(2'000'000);
    if (below(400) == 0) {
      uint8_t data[16];
      for (uint8_t& byte : data) byte = static_cast<uint8_t>(below(4) == 0 ? random() : below(3));
      const uint16_t value = static_cast<uint16_t>(below(3) == 0 ? random() : 0);
      const auto request = static_cast<uint8_t>(below(11));
      const uint16_t length = request == 3 ? 16 : request == 8 ? 4 : 0;
      const uint8_t type = below(2) == 0 ? 0xC1 : 0x41;
      const int32_t got =
          voxlink_request(device.get(), now, type, request, value, 0, data, length, &answer);
      ASSERT_LE(got, 0x70);
      if (request == 5 && got == 0) sequence = 0;
    }
    if (below(1000) == 0) {
      const uint8_t mode[16] = {static_cast<uint8_t>(below(5)), static_cast<uint8_t>(1 + below(64)),
                                static_cast<uint8_t>(below(9))};
      voxlink_request(device.get(), now, 0x41, 6, 0, 0, nullptr, 0, &answer);
      voxlink_request(device.get(), now, 0x41, 3, 0, 0, mode, 16, &answer);
    }
    if (!device->running) {
      voxlink_request(device.get(), now, 0x41, 5, 0, 0, nullptr, 0, &answer);
      sequence = 0;
    }
    std::vector<std::byte> payload;
    voxlink::PacketHeader header{};
    // Mostly packets that lead to a volume, so that volumes are completed.
    static constexpr uint8_t kRare[] = {0, 1, 3, 4, 5, 6, 7, 8};
    header.type = below(12) != 0 ? 2 : kRare[below(8)];
    if (device->filling == 0 && below(4) != 0) header.type = 1;
    header.flags = static_cast<uint8_t>(below(3));
    header.volume = device->last_begun + below(3);
    header.sequence = sequence++;
    if (header.type == 1) {
      payload.resize(16 + below(2) * ((device->pictures + 7) / 8));
      for (std::byte& byte : payload) byte = static_cast<std::byte>(random());
      if (payload.size() > 16) payload.back() = std::byte{0};
      const uint64_t base = payload.size() == 16 ? 0 : device->base;
      const uint32_t pictures = device->pictures + (below(20) == 0 ? 1 : 0);
      std::memcpy(payload.data(), &base, 8);
      std::memcpy(payload.data() + 8, &pictures, 4);
    } else if (header.type == 2) {
      header.volume = device->filling;
      uint32_t next = 0;  // the first picture that is not complete
      while (next + 1 < device->pictures &&
             (memory.filled[next] == ~0u || memory.filled[next] == device->picture_bytes)) {
        ++next;
      }
      if (below(10) == 0) next = below(device->pictures);
      const uint32_t subs = device->sub_frames;
      header.slice = below(30) == 0 ? static_cast<uint32_t>(random()) >> below(31) : next / subs;
      header.sub_frame = static_cast<uint16_t>(below(30) == 0 ? random() : next % subs);
      header.offset = below(10) == 0   ? static_cast<uint32_t>(random() % 40 - 8)
                      : below(10) == 0 ? memory.filled[next]
                                       : 0;
      payload.resize(below(10) == 0 ? below(1500) : device->picture_bytes);
    } else if (header.type == 5) {
      payload.resize(header.flags == 1 ? 16 : 8);
    }
    const std::vector<uint8_t> bytes = Packet(header, payload);
    voxlink_bulk(device.get(), now, bytes.data(), bytes.size() - (below(100) == 0 ? 1 : 0));
    voxlink_tick(device.get(), now);
    if (below(3) == 0) voxlink_sweep(device.get(), now);
    if (voxlink_light(device.get()) != nullptr) ++lit;
    while (below(4) != 0) {
      const size_t length = voxlink_event(device.get(), now, event);
      ASSERT_LE(length, 64u);
      if (length == 0) break;
      ++events;
    }
  }
  // It did get that far.
  EXPECT_GT(events, 50'000u);
  EXPECT_GT(lit, 1000u);
  const auto whole = [](const auto& guard) {
    const auto bytes = std::as_bytes(std::span(guard));
    return std::ranges::all_of(bytes, [](std::byte byte) { return byte == std::byte{0xA5}; });
  };
  EXPECT_TRUE(whole(memory.before) && whole(memory.between) && whole(memory.behind) &&
              whole(memory.last));
}

// ---- checked against the protocol

struct Held {
  std::string name;
  Options options;
  int seeds;
};
std::ostream& operator<<(std::ostream& out, const Held& held) { return out << held.name; }

class FirmwareIsHeld : public testing::TestWithParam<Held> {};

TEST_P(FirmwareIsHeld, PassesEveryCase) {
  Options options = GetParam().options;
  options.try_emplace("receive_buffer", "65536");
  options.try_emplace("max_payload", "4096");
  const simulated::EmulatedDevice emulated = Emulated(options);
  const voxlink::Configured configured{emulated.info.geometry, emulated.info.layout};
  for (int seed = 1; seed <= GetParam().seeds; ++seed) {
    sync::FakeClock clock;
    clock.Advance(kSecond);
    auto device = Make(emulated.config, clock);
    const FirmwareDevice* const held = device.get();
    conformance::Rig rig(std::move(device), clock, voxlink::MakeSuite(&configured));
    const absl::StatusOr<conformance::RunResult> run =
        rig.Run({.seed = static_cast<uint64_t>(seed)});
    ASSERT_TRUE(run.ok()) << run.status();
    ASSERT_EQ(conformance::FailedIds(*run), std::set<std::string>())
        << "seed " << seed << conformance::Failures(*run);
    EXPECT_GT(run->Count(conformance::Verdict::Kind::kPassed), 60u);
    EXPECT_FALSE(held->core().running);
  }
}

INSTANTIATE_TEST_SUITE_P(
    Firmware, FirmwareIsHeld,
    testing::Values(
        Held{"Stack", {{"size", "16x12x20"}, {"speed", "high"}}, 20},
        Held{"Rotor",
             {{"geometry", "rotor"}, {"size", "9x8"}, {"slices", "80"}, {"eccentricity", "1;-1"}},
             10},
        Held{"Lattice", {{"geometry", "lattice"}, {"size", "5x4x6"}, {"speed", "full"}}, 20},
        Held{"OnePixel", {{"size", "1x1x1"}, {"speed", "full"}}, 10},
        Held{"FastSweeps", {{"size", "8x8x8"}, {"rate", "400"}}, 3},
        Held{"NoWatchdog", {{"size", "8x8x8"}, {"watchdog", "false"}}, 3},
        // A list of missing pictures that has to be shortened, and capabilities of several pages.
        Held{"ManySlices",
             {{"size", "2x2x1500"}, {"max_payload", "16384"}, {"receive_buffer", "131072"}},
             2}),
    [](const auto& info) { return info.param.name; });

// ---- the real driver

class FirmwareRig : public testing::Test {
 protected:
  void Start(const Options& options) {
    const simulated::EmulatedDevice emulated = Emulated(options);
    auto device = Make(emulated.config, clock_);
    device_ = device.get();
    auto faults =
        std::make_unique<emulator::FaultInjector>(std::move(device), emulator::FaultPlan{}, clock_);
    faults_ = faults.get();
    InProcessTransport::Options carrier;
    carrier.own_thread = false;
    auto transport = std::make_unique<InProcessTransport>(std::move(faults), clock_, carrier);
    transport_ = transport.get();
    source_ = std::make_unique<FrameSource>(emulated.info.layout, 1);
    display_ =
        std::make_unique<voxlink::VoxlinkDisplay>(emulated.info, std::move(transport), clock_);
    ASSERT_TRUE(display_->Start(&recorder_, [this] { woken_ = true; }).ok());
    ASSERT_TRUE(RunUntil([&] { return display_->state() == DisplayState::kShowing; }))
        << display_->state_reason();
  }
  ~FirmwareRig() override {
    if (display_ != nullptr) display_->Stop();
  }
  bool RunUntil(const std::function<bool()>& done, sync::TimeNs limit = 20 * kSecond) {
    const sync::TimeNs end = clock_.Now() + limit;
    while (true) {
      sync::TimeNs next = 0;
      do {
        woken_ = false;
        next = display_->Tick();
        next = std::min(next, transport_->Pump());
      } while (woken_ || next <= clock_.Now());
      if (done()) return true;
      if (next > end) return false;
      clock_.AdvanceTo(next);
    }
  }
  bool Shows(const SliceFrame& frame) const {
    return std::ranges::equal(device_->Light(), frame.bytes);
  }

  sync::FakeClock clock_;
  Recorder recorder_;
  std::unique_ptr<FrameSource> source_;
  std::unique_ptr<voxlink::VoxlinkDisplay> display_;
  FirmwareDevice* device_ = nullptr;
  emulator::FaultInjector* faults_ = nullptr;
  InProcessTransport* transport_ = nullptr;
  bool woken_ = false;
};

TEST_F(FirmwareRig, LightsWhatTheDriverSendsWholeAndChanged) {
  for (const Options& options :
       {Options{{"size", "8x8x6"}}, Options{{"size", "9x6x6"}, {"format", "hub75"}, {"bits", "4"}},
        Options{{"geometry", "rotor"},
                {"size", "16x8"},
                {"slices", "90"},
                {"format", "bitplanes"},
                {"sub_frames", "3"}}}) {
    if (display_ != nullptr) display_->Stop();
    recorder_ = {};
    Start(options);
    for (const double share : {1.0, 0.3, 0.01, 0.0, 0.5, 1.0}) {
      const SliceFramePtr frame = source_->Next(share);
      display_->Submit(frame);
      ASSERT_TRUE(RunUntil([&] { return recorder_.Of(frame->volume) != nullptr; }));
      EXPECT_EQ(recorder_.Of(frame->volume)->kind, VolumeOutcome::Kind::kPresented)
          << recorder_.Of(frame->volume)->reason;
      EXPECT_TRUE(Shows(*frame)) << "volume " << frame->volume;
    }
    EXPECT_EQ(device_->errors(), 0);
    EXPECT_EQ(display_->stats().attaches, 1u);
  }
}

TEST_F(FirmwareRig, GoesDarkWithTheHostAndObeysBlankAndBrightness) {
  Start({{"size", "8x8x6"}});
  const SliceFramePtr frame = source_->Next(1);
  display_->Submit(frame);
  ASSERT_TRUE(RunUntil([&] { return Shows(*frame); }));
  // Nothing ticks the driver: the device is alone.
  const sync::TimeNs begin = clock_.Now();
  while (!device_->Light().empty() && clock_.Now() < begin + kSecond) {
    clock_.Advance(kMillisecond);
    transport_->Pump();
  }
  EXPECT_GE(clock_.Now() - begin, 150 * kMillisecond);
  EXPECT_LE(clock_.Now() - begin, 251 * kMillisecond);
  EXPECT_TRUE(RunUntil([&] { return Shows(*frame); }));
  ASSERT_TRUE(display_->SetBlank(true).ok());
  EXPECT_TRUE(RunUntil([&] { return device_->Light().empty(); }, kSecond));
  ASSERT_TRUE(display_->SetBlank(false).ok());
  EXPECT_TRUE(RunUntil([&] { return Shows(*frame); }, kSecond));
  ASSERT_TRUE(display_->SetBrightness(0.5).ok());
  EXPECT_TRUE(RunUntil([&] { return device_->core().brightness / 65535.0 < 0.51; }, kSecond));
}

TEST_F(FirmwareRig, OverABadCableIsNeverHalfSeenAndComesRight) {
  Start({{"size", "16x16x20"}, {"max_payload", "1024"}, {"receive_buffer", "65536"}});
  std::vector<SliceFramePtr> all;
  std::mt19937 random(7);
  using What = emulator::Fault::What;
  for (int i = 0; i < 60; ++i) {
    const What what = std::array{What::kDrop, What::kCorrupt, What::kStall, What::kPartial}[i % 4];
    transport_->WithDevice([&](UsbDeviceModel&) {
      faults_->Add({.when = emulator::Fault::When::kByte,
                    .at = random() % 15'000,
                    .what = what,
                    .amount = 1 + random() % 300});
    });
    all.push_back(source_->Next(0.5));
    display_->Submit(all.back());
    ASSERT_TRUE(RunUntil([&] {
      if (!device_->Light().empty()) {
        const bool whole = std::ranges::any_of(all, [&](const auto& f) { return Shows(*f); });
        EXPECT_TRUE(whole) << "the lit picture is none of the " << all.size() << " volumes";
        if (!whole) return true;
      }
      return recorder_.Of(all.back()->volume) != nullptr;
    }));
    if (HasFailure()) return;
  }
  EXPECT_GT(device_->errors(), 10);
  transport_->WithDevice([&](UsbDeviceModel&) { faults_->Clear(); });
  display_->Submit(all.emplace_back(source_->Next(0.5)));
  EXPECT_TRUE(RunUntil([&] { return Shows(*all.back()); }));
}

TEST_F(FirmwareRig, ComesBackAfterAnUnplug) {
  Start({{"size", "8x8x6"}});
  const SliceFramePtr frame = source_->Next(1);
  display_->Submit(frame);
  ASSERT_TRUE(RunUntil([&] { return Shows(*frame); }));
  transport_->WithDevice([](UsbDeviceModel& device) { device.SetPlugged(false); });
  ASSERT_TRUE(RunUntil([&] { return display_->state() == DisplayState::kLost; }));
  EXPECT_TRUE(device_->Light().empty());
  transport_->WithDevice([](UsbDeviceModel& device) { device.SetPlugged(true); });
  EXPECT_TRUE(RunUntil([&] { return Shows(*frame); }));
}

}  // namespace
}  // namespace voxeld::display
