// Where transports to devices come from: the machine's USB, or a test's.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "display/usb/usb_transport.h"

namespace voxeld::display {

// Which device. What is left out matches any.
struct UsbMatch {
  std::optional<uint16_t> vendor_id, product_id;
  std::string serial;
  std::string path;  // its place: bus, then ports, "1-2.4"
  // Class, subclass and protocol of the interface that is claimed; without it interface 0 is.
  std::optional<std::array<uint8_t, 3>> interface;
  // Of `count` devices that match all the rest and belong to nobody outside `group`, number `index` by
  // ascending serial number, then by place. None is there before all are: which is which would depend
  // on the order of arrival.
  struct Member {
    size_t index = 0, count = 1;
    std::string group;  // not empty; the bus's transports of one group share its devices
  };
  std::optional<Member> member;

  // "1d50:607a with serial X at 1-2", for messages.
  std::string ToString() const;
};

class UsbBus {
 public:
  virtual ~UsbBus() = default;
  // A closed transport whose Open looks for a device that matches and that no other transport of
  // this bus has open. Any thread. The bus outlives its transports.
  virtual std::unique_ptr<UsbTransport> MakeTransport(UsbMatch match) = 0;
};

}  // namespace voxeld::display
