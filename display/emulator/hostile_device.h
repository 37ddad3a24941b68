// A device that lies: its descriptions and reports are damaged at random: bits, lengths, ends, or
// everything. It wraps any model, which does not notice.
//
// Deterministic: the seed and the host's requests determine everything.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <random>
#include <span>
#include <utility>
#include <vector>

#include "display/usb/device_model.h"

namespace voxeld::display::emulator {

class HostileDevice final : public UsbDeviceModel {
 public:
  explicit HostileDevice(std::unique_ptr<UsbDeviceModel> device) : device_(std::move(device)) {}

  // Takes effect with the next answer; without a seed the device tells the truth.
  void SetSeed(std::optional<uint64_t> seed);
  // Returns how many answers and reports were damaged.
  uint64_t lies() const { return lies_; }

  void SetComplete(Complete complete) override;
  void Submit(const Urb& urb) override;
  bool Unlink(uint64_t id) override;
  void Tick() override { device_->Tick(); }
  sync::TimeNs NextTimeout() const override { return device_->NextTimeout(); }
  UsbSpeed speed() const override { return device_->speed(); }
  void Reset() override { device_->Reset(); }
  void SetPlugged(bool plugged) override { device_->SetPlugged(plugged); }
  bool plugged() const override { return device_->plugged(); }
  uint32_t plugs() const override { return device_->plugs(); }

 private:
  void OnComplete(uint64_t id, TransferStatus status, uint32_t actual,
                  std::span<const std::byte> in);
  // Returns damaged bytes, at most `most`, the number that the host asked for.
  std::vector<std::byte> Damaged(std::span<const std::byte> in, size_t most);
  uint64_t Below(uint64_t end) { return random_() % end; }

  const std::unique_ptr<UsbDeviceModel> device_;
  Complete complete_;
  bool lying_ = false;
  std::mt19937_64 random_;
  std::map<uint64_t, uint32_t> asked_;  // bytes requested by IN URBs inside the device
  uint64_t lies_ = 0;
};

}  // namespace voxeld::display::emulator
