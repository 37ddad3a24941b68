// The host's side of usbredir, as in QEMU: the parser of the usbredir project over a socket, with a
// record of what it received.
#pragma once

#include <usbredirparser.h>

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "tests/display/emulator/carriers/peer.h"

namespace voxeld::display::emulator {

class UsbredirHost {
 public:
  struct Answer {
    uint64_t id = 0;
    uint8_t endpoint = 0, status = 0;
    uint32_t length = 0;
    Bytes data;
  };

  // Sends hello at the next Write.
  explicit UsbredirHost(Peer& peer);
  usbredirparser* parser() { return parser_.get(); }
  // Sends what was given to the parser; reads what has arrived. Returns false if it was not
  // usbredir.
  bool Write() { return usbredirparser_do_write(parser_.get()) == 0; }
  bool Read() { return usbredirparser_do_read(parser_.get()) == 0; }

  // These send requests at once.
  void Control(uint64_t id, uint8_t type, uint8_t request, uint16_t value, uint16_t length,
               Bytes data = {}, uint16_t index = 0);
  void BulkOut(uint64_t id, uint8_t endpoint, Bytes data);
  void StartInterrupts(uint64_t id, uint8_t endpoint);
  void StopInterrupts(uint64_t id, uint8_t endpoint);

  std::optional<usb_redir_device_connect_header> device;
  usb_redir_ep_info_header endpoints{};
  usb_redir_interface_info_header interfaces{};
  int connects = 0, disconnects = 0;
  std::vector<Answer> controls, bulks, interrupts, receiving, streams;
  std::vector<uint8_t> configurations, alternates;

 private:
  struct Callbacks;
  Peer& peer_;
  const std::unique_ptr<usbredirparser, void (*)(usbredirparser*)> parser_;
};

}  // namespace voxeld::display::emulator
