// A voxlink device that lies, controlled by a script: it wraps a model, whose answers and reports
// it forwards, changes, holds back or repeats. Each answer is counted (tests/fuzz/exchanges.h).
// Like its model, it is single-threaded.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <span>
#include <vector>

#include "display/sync/clock.h"
#include "display/usb/device_model.h"
#include "tests/fuzz/exchanges.h"
#include "tests/fuzz/script.h"

namespace voxeld::fuzz {

class LyingDevice final : public display::UsbDeviceModel {
 public:
  struct Ways {
    // 0: every other answer is a lie; 1 to 3: lies are increasingly rare, and of more kinds.
    uint8_t rarity = 0;
    // Added to the numbers of incoming packets and of outgoing events, and to the device's time.
    uint32_t sequence_shift = 0;
    uint64_t time_shift = 0;
  };
  // `script` and `clock` outlive it.
  LyingDevice(std::unique_ptr<display::UsbDeviceModel> device, sync::Clock& clock, Script& script,
              const Ways& ways)
      : device_(std::move(device)), clock_(clock), script_(script), ways_(ways) {}

  // Stops lying from now on; the numbers stay shifted.
  void TellTheTruth() { truthful_ = true; }

  void SetComplete(Complete complete) override;
  void Submit(const display::Urb& urb) override;
  bool Unlink(uint64_t id) override;
  void Tick() override;
  sync::TimeNs NextTimeout() const override;
  display::UsbSpeed speed() const override { return device_->speed(); }
  void Reset() override;
  void SetPlugged(bool plugged) override;
  bool plugged() const override { return device_->plugged(); }
  uint32_t plugs() const override { return device_->plugs(); }

 private:
  struct Asked {
    size_t in = 0, out = 0;
    ExchangeKind kind = ExchangeKind::kWrite;
    std::vector<std::byte> copy;  // the bytes that the device gets in place of those that were sent
    bool damaged = false;
  };
  struct Late {
    sync::TimeNs due = 0;
    uint64_t id = 0;
    display::TransferStatus status{};
    uint32_t actual = 0;
    std::vector<std::byte> in;
  };

  void Answer(uint64_t id, display::TransferStatus status, uint32_t actual,
              std::span<const std::byte> in);
  ExchangeOutcome Lie(uint64_t id, const Asked& asked, display::TransferStatus status,
                      uint32_t actual, std::vector<std::byte> told);
  void Tell(uint64_t id, const Asked& asked, std::vector<std::byte> told);
  void EndLate(display::TransferStatus status);
  void Shift(ExchangeKind kind, std::span<std::byte> told) const;

  const std::unique_ptr<display::UsbDeviceModel> device_;
  sync::Clock& clock_;
  Script& script_;
  const Ways ways_;
  Complete complete_;
  std::map<uint64_t, Asked> asked_;
  std::deque<Late> late_;
  std::map<ExchangeKind, std::vector<std::byte>> before_;  // answers to repeat
  bool truthful_ = false;
};

}  // namespace voxeld::fuzz
