// What a driver gets from whoever creates displays.
#pragma once

#include <functional>
#include <utility>

#include "absl/status/statusor.h"
#include "display/sync/clock.h"
#include "display/usb/usb_bus.h"

namespace voxeld::display {

struct DriverContext {
  // Without USB.
  DriverContext(sync::Clock& time)  // NOLINT(google-explicit-constructor): a clock is enough
      : clock(time), usb([]() -> absl::StatusOr<UsbBus*> {
          return absl::UnavailableError("there is no USB here");
        }) {}
  DriverContext(sync::Clock& time, std::function<absl::StatusOr<UsbBus*>()> bus)
      : clock(time), usb(std::move(bus)) {}

  sync::Clock& clock;  // outlives the display
  // The USB that displays share; outlives the display. Asked for by those alone that need it.
  std::function<absl::StatusOr<UsbBus*>()> usb;
};

}  // namespace voxeld::display
