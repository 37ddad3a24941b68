// The C99 device: the protocol page's own bytes, the suite that holds devices to the protocol, and the real driver over a sound
// and over a bad cable.
#include <algorithm>
#include <map>
#include <memory>
#include <ostream>
#include <random>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "display/drivers/simulated/emulated_device.h"
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

// ---- held to the protocol

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
        // A list of what is missing that has to be made shorter, and capabilities of several pages.
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
  // Nobody ticks the driver: the device is alone.
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
        EXPECT_TRUE(whole) << "what is lit is none of the " << all.size() << " volumes";
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
