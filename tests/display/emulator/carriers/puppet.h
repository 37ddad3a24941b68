// A device model that does nothing by itself but tell its descriptors: what is submitted waits until the test
// says how it ends.
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

  // By id. What a carrier asks for itself (GET_DESCRIPTOR) is answered, and not among them, while `answers_descriptors`.
  std::map<uint64_t, Seen> pending;
  std::vector<uint64_t> unlinked;
  int resets = 0;
  bool answers_descriptors = true;

  // The only one that is pending on the endpoint; 0: there is none, or more than one.
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
