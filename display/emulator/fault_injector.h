// Injects faults on the cable of a device model, outside its protocol: any model can be wrapped,
// and neither the model nor the host notices.
//
// Deterministic: a plan and a clock determine everything.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "display/sync/clock.h"
#include "display/usb/device_model.h"

namespace voxeld::display::emulator {

struct Fault {
  enum class When : uint8_t {
    kTransfer,  // at the `at`-th transfer on the endpoint, from 1
    kByte,      // at the transfer that contains byte `at` of the endpoint's stream
    kTime,  // `at` ns after the injector was made: then, or at the next transfer if it needs one
  };
  enum class What : uint8_t {
    kStall,    // the endpoint halts
    kNak,      // transfers wait for `amount` ns
    kPartial,  // `amount` bytes pass, then the endpoint halts
    kError,    // `amount` transfers end in a protocol error; nothing passes
    kBabble,   // `amount` transfers end in an overflow, as if the device sent more than requested
    kCorrupt,  // the byte `amount` of the transfer is inverted (kByte: the one at `at`)
    kDrop,     // `amount` bytes of the transfer vanish, from its middle (kByte: from `at`);
               // reported as sent
    kUnplug,   // the cable is unplugged for `amount` ns
    kDelay,    // completions are held back for `amount` ns
  };
  When when = When::kTransfer;
  uint64_t at = 1;
  uint8_t endpoint = 0x01;
  What what = What::kStall;
  uint64_t amount = 0;
};

using FaultPlan = std::vector<Fault>;

// Parses "WHAT[:AMOUNT]@WHEN[/in]", several separated by ';'. WHAT: stall, nak:MS, partial:BYTES,
// error:COUNT, babble:COUNT, corrupt:BYTE, drop:BYTES, unplug:MS, delay:MS. WHEN: tN (transfer N),
// bN (byte N), Nms. "/in": on the interrupt endpoint. Errors: InvalidArgument with what is wrong.
absl::StatusOr<FaultPlan> ParseFaultPlan(std::string_view text);

// Returns the text that ParseFaultPlan reads; amounts and times of timed faults in whole ms.
std::string ToText(const Fault& fault);

class FaultInjector final : public UsbDeviceModel {
 public:
  FaultInjector(std::unique_ptr<UsbDeviceModel> device, FaultPlan plan, sync::Clock& clock);

  // Adds a fault; its transfers, bytes and times count from now on.
  void Add(Fault fault);
  size_t faults_left() const { return plan_.size(); }
  // Removes all planned faults and ends all that still last, and starts to count again.
  void Clear();

  void SetComplete(Complete complete) override { complete_ = std::move(complete); }
  void Submit(const Urb& urb) override;
  bool Unlink(uint64_t id) override;
  void Tick() override;
  sync::TimeNs NextTimeout() const override;
  UsbSpeed speed() const override { return device_->speed(); }
  void Reset() override;
  void SetPlugged(bool plugged) override;
  bool plugged() const override { return device_->plugged(); }
  uint32_t plugs() const override { return device_->plugs(); }

 private:
  struct Endpoint {
    uint64_t transfers = 0, bytes = 0;
    bool halted = false;
    uint64_t errors_left = 0, babbles_left = 0;
    sync::TimeNs nak_until = 0;
    sync::TimeNs hold_until = 0;
    std::deque<Urb> waiting;  // while NAKed
  };
  struct Held {  // a delayed completion
    uint64_t id;
    uint8_t endpoint;
    TransferStatus status;
    uint32_t actual;
    std::vector<std::byte> in;
  };
  struct Passing {  // an URB inside the device
    uint8_t endpoint = 0;
    std::vector<std::byte> changed;  // bytes that replace the host's
    bool halts = false;              // ends in a stall
    uint32_t claim = 0;              // bytes to report as sent; 0: the device's number
  };

  void Pass(const Urb& urb);
  // Ends everything that waits or is delayed.
  void EndAll(TransferStatus status);
  // Applies the faults for this URB; returns false if it does not go to the device now.
  bool Apply(const Urb& original, Urb& urb, Passing& passing);
  void Act(const Fault& fault, sync::TimeNs now);
  void OnComplete(uint64_t id, TransferStatus status, uint32_t actual,
                  std::span<const std::byte> in);

  std::unique_ptr<UsbDeviceModel> device_;
  sync::Clock& clock_;
  Complete complete_;
  struct Planned {
    Fault fault;
    sync::TimeNs time;  // for kTime
  };
  std::vector<Planned> plan_;
  std::map<uint8_t, Endpoint> endpoints_;
  std::map<uint64_t, Passing> passing_;
  std::deque<Held> held_;
  sync::TimeNs replug_at_ = sync::kNever;
};

}  // namespace voxeld::display::emulator
