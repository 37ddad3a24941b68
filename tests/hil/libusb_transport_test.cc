// Tests libusb's transport on this system's USB, which is either a real kernel's with an emulated
// device, or a fake one.
// VOXELD_EMULATOR_CONTROL: the control socket of the emulator that provides
// "voxlink,size=4x4x2,rate=100,serial=hil".
// VOXELD_HIL_RETRIES, if set: the host controller retries after a protocol error, as xhci does.

#include <cstdlib>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>

#include "display/sync/clock.h"
#include "display/usb/libusb/libusb_bus.h"
#include "gtest/gtest.h"
#include "tests/display/usb/transport_conformance.h"
#include "tests/hil/control_client.h"

namespace voxeld::display {
namespace {

std::string ControlPath() {
  const char* path = std::getenv("VOXELD_EMULATOR_CONTROL");
  if (path == nullptr) throw std::runtime_error("VOXELD_EMULATOR_CONTROL names no emulator");
  return path;
}

class SystemCarrier final : public Carrier {
 public:
  SystemCarrier() : control_(ControlPath()) {
    absl::StatusOr<std::unique_ptr<LibusbBus>> bus = LibusbBus::Make(clock_);
    if (!bus.ok()) throw std::runtime_error(std::string(bus.status().message()));
    bus_ = *std::move(bus);
    transport_ = bus_->MakeTransport({.vendor_id = 0x1209,
                                      .product_id = 0x0001,
                                      .serial = "hil",
                                      .interface = {{0xFF, 0x56, 0x01}}});
    transport_->SetWake([this] {
      sync::MutexLock lock(mutex_);
      woken_ = true;
      wake_.NotifyAll();
    });
    // Resets the device to its initial state.
    control_.Ask("unplug");
    control_.Ask("clear");
    Require([&] {
      const bool gone = absl::IsNotFound(transport_->Open());
      transport_->Close();
      return gone;
    });
    control_.Ask("plug");
    Require([&] { return (opened_ = transport_->Open()).ok(); });
    transport_->Close();
  }
  ~SystemCarrier() override { transport_->SetWake(nullptr); }

  Limits limits() const override {
    return {.errors_are_retried = std::getenv("VOXELD_HIL_RETRIES") != nullptr};
  }
  UsbTransport& transport() override { return *transport_; }
  void AddFault(const emulator::Fault& fault) override {
    control_.Ask("fault " + emulator::ToText(fault));
  }
  void SetPlugged(bool plugged) override { control_.Ask(plugged ? "plug" : "unplug"); }
  // Some events do not wake it (a device that is removed while none is open), so it checks again
  // now and then.
  bool RunUntil(const std::function<bool()>& done) override {
    const sync::TimeNs end = clock_.Now() + 20 * sync::kSecond;
    while (!done()) {
      if (clock_.Now() >= end) return false;
      sync::MutexLock lock(mutex_);
      if (!woken_) clock_.WaitUntil(mutex_, wake_, clock_.Now() + 5 * sync::kMillisecond);
      woken_ = false;
    }
    return true;
  }

 private:
  void Require(const std::function<bool()>& done) {
    if (RunUntil(done)) return;
    throw std::runtime_error("the emulated device does not come and go: " +
                             std::string(opened_.message()));
  }

  sync::SystemClock clock_;
  absl::Status opened_;
  hil::ControlClient control_;
  sync::Mutex mutex_;
  sync::CondVar wake_;
  bool woken_ VOXELD_GUARDED_BY(mutex_) = false;
  std::unique_ptr<LibusbBus> bus_;
  std::unique_ptr<UsbTransport> transport_;
};

INSTANTIATE_TEST_SUITE_P(
    System, TransportConformance,
    testing::Values(CarrierCase{"Libusb", [] { return std::make_unique<SystemCarrier>(); }}),
    [](const testing::TestParamInfo<CarrierCase>& param) { return param.param.name; });

}  // namespace
}  // namespace voxeld::display
