// Tests the transports within this process, bare and wrapped.

#include <functional>
#include <memory>
#include <utility>

#include "display/emulator/fault_injector.h"
#include "display/emulator/voxlink_device.h"
#include "display/sync/clock.h"
#include "display/sync/fake_clock.h"
#include "display/usb/faulty_transport.h"
#include "display/usb/in_process.h"
#include "display/usb/recording_transport.h"
#include "gtest/gtest.h"
#include "tests/display/usb/transport_conformance.h"
#include "tests/display/usb/transport_rig.h"

namespace voxeld::display {
namespace {

using emulator::Fault;
using sync::kMillisecond;
using sync::kSecond;

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

// Wraps the in-process transport.
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
  explicit PumpedCarrier(const Wrap& wrap) {
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
  Limits limits() const override { return {.max_bytes_in_flight = kInFlight}; }
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
  explicit ThreadedCarrier(const Wrap& wrap) {
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
  Limits limits() const override { return {.max_bytes_in_flight = kInFlight}; }
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

INSTANTIATE_TEST_SUITE_P(
    Carriers, TransportConformance,
    testing::Values(
        CarrierCase{"InProcessPumped", [] { return std::make_unique<PumpedCarrier>(Bare); }},
        CarrierCase{"InProcessThreaded", [] { return std::make_unique<ThreadedCarrier>(Bare); }},
        CarrierCase{"RecordedPumped", [] { return std::make_unique<PumpedCarrier>(Recorded); }},
        CarrierCase{"RecordedThreaded", [] { return std::make_unique<ThreadedCarrier>(Recorded); }},
        CarrierCase{"FaultlessPumped", [] { return std::make_unique<PumpedCarrier>(Faultless); }},
        CarrierCase{"FaultlessThreaded",
                    [] { return std::make_unique<ThreadedCarrier>(Faultless); }}),
    [](const testing::TestParamInfo<CarrierCase>& param) { return param.param.name; });

}  // namespace
}  // namespace voxeld::display
