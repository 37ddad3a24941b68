// The environment that the creator of displays gives to a driver.
#pragma once

#include <functional>
#include <utility>

#include "absl/status/statusor.h"
#include "display/sync/clock.h"
#include "display/usb/usb_bus.h"

namespace voxeld::display {

struct DriverContext {
  // A context without USB.
  DriverContext(sync::Clock& time)  // NOLINT(google-explicit-constructor): a clock is enough
      : clock(time), usb([]() -> absl::StatusOr<UsbBus*> {
          return absl::UnavailableError("there is no USB here");
        }) {}
  DriverContext(sync::Clock& time, std::function<absl::StatusOr<UsbBus*>()> bus)
      : clock(time), usb(std::move(bus)) {}

  sync::Clock& clock;  // must outlive the display
  // Returns the USB bus that displays share; it must outlive the display. Only drivers that need it
  // call this.
  std::function<absl::StatusOr<UsbBus*>()> usb;
};

}  // namespace voxeld::display
