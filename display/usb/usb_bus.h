// The source of transports to devices: the machine's USB, or a test's.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "display/usb/usb_transport.h"

namespace voxeld::display {

// Selects a device. Fields that are not set match any.
struct UsbMatch {
  std::optional<uint16_t> vendor_id, product_id;
  std::string serial;
  std::string path;  // its position: bus, then ports, "1-2.4"
  // Class, subclass and protocol of the interface to claim; without it, interface 0 is claimed.
  std::optional<std::array<uint8_t, 3>> interface;
  // Selects, of `count` devices that match everything else and are not in use outside `group`,
  // number `index` by ascending serial number, then by position. None matches before all are
  // present, because the numbering would otherwise depend on the order of arrival.
  struct Member {
    size_t index = 0, count = 1;
    std::string group;  // not empty; the bus's transports of one group share its devices
  };
  std::optional<Member> member;

  // Returns "1d50:607a with serial X at 1-2", for messages.
  std::string ToString() const;
};

class UsbBus {
 public:
  virtual ~UsbBus() = default;
  // Returns a closed transport whose Open looks for a device that matches and that no other
  // transport of this bus has open. Any thread. The bus must outlive its transports.
  virtual std::unique_ptr<UsbTransport> MakeTransport(UsbMatch match) = 0;
};

}  // namespace voxeld::display
