// A device model that by itself only answers with its descriptors: submitted transfers wait until
// the test ends them.
#pragma once

#include <cstdint>
#include <map>
#include <vector>

#include "display/emulator/descriptors.h"
#include "display/usb/device_model.h"

namespace voxeld::display::emulator {

class Puppet final : public UsbDeviceModel {
 public:
  struct Seen {
    Urb urb;  // its `out` is empty
    std::vector<std::byte> out;
  };

  // By id. While `answers_descriptors`, the carrier's own requests (GET_DESCRIPTOR) are answered
  // and are not listed.
  std::map<uint64_t, Seen> pending;
  std::vector<uint64_t> unlinked;
  int resets = 0;
  bool answers_descriptors = true;

  // Returns the only transfer that is pending on the endpoint; 0: none is pending, or several are.
  uint64_t Only(uint8_t endpoint) const;
  void End(uint64_t id, TransferStatus status, uint32_t actual = 0,
           std::span<const std::byte> in = {});

  void SetComplete(Complete complete) override { complete_ = std::move(complete); }
  void Submit(const Urb& urb) override;
  bool Unlink(uint64_t id) override;
  void Tick() override {}
  sync::TimeNs NextTimeout() const override { return sync::kNever; }
  UsbSpeed speed() const override { return UsbSpeed::kHigh; }
  void Reset() override;
  void SetPlugged(bool plugged) override;
  bool plugged() const override { return plugged_; }
  uint32_t plugs() const override { return plugs_; }

 private:
  void EndAll(TransferStatus status);

  const DescriptorSet descriptors_ = MakeDescriptors(UsbSpeed::kHigh, "puppet");
  Complete complete_;
  bool plugged_ = true;
  uint32_t plugs_ = 1;
};

}  // namespace voxeld::display::emulator
