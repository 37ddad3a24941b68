// A device model driven by hand: the test sends requests and packets, and events and completions
// are recorded.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "display/drivers/voxlink/packet.h"
#include "display/drivers/voxlink/protocol.h"
#include "display/emulator/fault_injector.h"
#include "display/emulator/voxlink_device.h"
#include "display/sync/fake_clock.h"

namespace voxeld::display::emulator {

struct Completed {
  TransferStatus status = TransferStatus::kOk;
  uint32_t actual = 0;
  std::vector<std::byte> in;
};

struct SeenEvent {
  voxlink::EventHeader header;
  std::vector<std::byte> body;
  voxlink::EventType type() const { return static_cast<voxlink::EventType>(header.type); }
  template <typename T>
  T As() const {
    return voxlink::Load<T>(body);
  }
};

class Bench {
 public:
  // 4 slices of 3x2 pixels, RGB888, 10 volumes/s.
  static VoxlinkDeviceConfig SmallConfig();
  explicit Bench(VoxlinkDeviceConfig config = SmallConfig(), FaultPlan plan = {});

  sync::FakeClock& clock() { return clock_; }
  UsbDeviceModel& model() { return *injector_; }
  FaultInjector& injector() { return *injector_; }
  VoxlinkDevice& device() { return *device_; }
  voxlink::PacketWriter& writer() { return writer_; }

  // Submits a transfer. If it completed, returns how.
  std::optional<Completed> Control(const UsbSetup& setup, std::span<const std::byte> out = {});
  std::optional<Completed> In(voxlink::Request request, uint16_t value, uint16_t length);
  std::optional<Completed> Out(voxlink::Request request, uint16_t value = 0,
                               std::span<const std::byte> data = {});
  // Submits a bulk OUT transfer. Returns its id, for Result.
  uint64_t Bulk(std::vector<std::byte> bytes);
  std::optional<Completed> Result(uint64_t id) const;

  // Sends START, with reads waiting for events.
  void StartSession();
  // Advances the time; ticks the model as often as it wants.
  void Pass(sync::TimeNs duration);
  // Returns the events since the last call; sweeps, health and credit only if `all`.
  std::vector<SeenEvent> Events(bool all = false);

  // Returns packets of volumes whose pictures have all bytes `value`.
  std::vector<std::byte> Begin(uint64_t volume, uint64_t base, std::optional<uint8_t> bits = {});
  std::vector<std::byte> Slice(uint64_t volume, uint32_t slice, uint8_t value);
  std::vector<std::byte> End(uint64_t volume, bool show = true);
  void SendWhole(uint64_t volume, uint8_t value, bool show = true);
  // Returns the visible value of a slice's bytes; −1: dark.
  int Seen(size_t slice) const;

 private:
  void Submit(Urb urb);
  void PostReads();

  sync::FakeClock clock_;
  VoxlinkDevice* device_ = nullptr;
  std::unique_ptr<FaultInjector> injector_;
  voxlink::PacketWriter writer_;
  uint64_t next_id_ = 1;
  std::map<uint64_t, std::vector<std::byte>> out_;  // the buffers of URBs
  std::map<uint64_t, Completed> done_;
  std::vector<uint64_t> reads_;
  bool listening_ = false;
  std::vector<SeenEvent> events_;
};

}  // namespace voxeld::display::emulator
