// The voxlink driver over any transport, in one thread, on a clock that a test moves; and the parts
// of which such transports are made.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <vector>

#include "display/drivers/voxlink/voxlink_display.h"
#include "display/emulator/voxlink_device.h"
#include "display/sync/fake_clock.h"
#include "display/usb/in_process.h"
#include "display/usb/packet_recorder.h"
#include "tests/display/drivers/rig.h"

namespace voxeld::display {

// A recording in memory.
class MemoryRecording {
 public:
  std::unique_ptr<PacketRecorder> MakeRecorder();
  // May be called once the recorder is destroyed.
  const std::vector<std::byte>& bytes() const { return *bytes_; }

 private:
  std::shared_ptr<std::vector<std::byte>> bytes_ = std::make_shared<std::vector<std::byte>>();
};

// A small planar display, 8x8x6.
DisplayInfo SmallDisplay();

// A device of that display at the end of a cable that a test pumps.
struct EmulatedCable {
  explicit EmulatedCable(sync::Clock& clock);
  std::unique_ptr<InProcessTransport> transport;  // may be moved away
  InProcessTransport* pump;
  emulator::VoxlinkDevice* device;  // use only within pump->WithDevice
};

class TransportRig {
 public:
  // Does what is due, and returns when it must be called again.
  using Pump = std::function<sync::TimeNs()>;

  // `pumps` are those of everything that runs between driver and device, the device's end first.
  TransportRig(std::unique_ptr<UsbTransport> transport, sync::FakeClock& clock,
               std::vector<Pump> pumps);
  ~TransportRig() { display_.Stop(); }

  Display& display() { return display_; }
  Recorder& recorder() { return recorder_; }

  void Start();
  void Settle();
  // Advances the time to what is due next, step by step. Returns false if it was not done within
  // `limit`.
  bool RunUntil(const std::function<bool()>& done, sync::TimeNs limit = 10 * sync::kSecond);
  void RunFor(sync::TimeNs duration);

 private:
  sync::FakeClock& clock_;
  const std::vector<Pump> pumps_;
  Recorder recorder_;
  voxlink::VoxlinkDisplay display_;
  bool woken_ = false;
  sync::TimeNs next_ = 0;
};

}  // namespace voxeld::display
