// A transport that fails as real ones do, where a plan says so: refused calls, and completions that
// are late or tell something else than what happened. What passes below it is real: a transfer whose
// completion is replaced has done what it did.
//
// Deterministic: the plan, the order of calls and a clock decide everything. Faults of the cable and
// of the device are for emulator/fault_injector.h.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <thread>
#include <vector>

#include "absl/status/status.h"
#include "display/sync/clock.h"
#include "display/sync/mutex.h"
#include "display/usb/usb_transport.h"

namespace voxeld::display {

struct TransportFault {
  enum class Where : uint8_t {
    kOpen,
    kSubmit,      // ClearHalt and Reset count as well
    kCompletion,  // in the order in which they happen
  };
  Where where = Where::kSubmit;
  uint64_t at = 1;     // which of them, from 1, since the transport was made
  uint64_t count = 1;  // so many in a row
  // kOpen, kSubmit: what they return; the transport below is not called.
  absl::Status refusal = absl::UnavailableError("a fault was planned here");
  // kCompletion: what it says instead. An IN transfer keeps actual_length of its bytes, none if that
  // is not set and `status` is neither kOk nor kShort. kDisconnected takes everything else in flight
  // with it and lasts until Close.
  std::optional<TransferStatus> status;
  std::optional<uint32_t> actual_length;  // what it claims, true or not
  // kCompletion: it comes so much later, and what follows it on its endpoint not before it.
  sync::TimeNs hold = 0;
};

class FaultyTransport final : public UsbTransport {
 public:
  struct Options {
    bool own_thread = true;  // to wake for what is held back; false: the owner calls Pump
  };

  FaultyTransport(std::unique_ptr<UsbTransport> inner, std::vector<TransportFault> plan,
                  sync::Clock& clock, Options options);
  ~FaultyTransport() override;

  // How many calls and completions a fault has met.
  uint64_t hits() const { return hits_; }

  absl::Status Open() override;
  void Close() override;
  bool is_open() const override { return inner_->is_open(); }
  UsbIdentity identity() const override { return inner_->identity(); }
  absl::StatusOr<TransferId> Submit(Transfer&& transfer) override;
  void Cancel(TransferId id) override { inner_->Cancel(id); }
  absl::StatusOr<TransferId> ClearHalt(uint8_t endpoint) override;
  absl::StatusOr<TransferId> Reset() override;
  TransferBytes TakeBuffer(size_t capacity) override { return inner_->TakeBuffer(capacity); }
  size_t Drain(std::vector<TransferCompletion>& out) override;
  size_t bytes_in_flight() const override { return inner_->bytes_in_flight(); }
  size_t max_bytes_in_flight() const override { return inner_->max_bytes_in_flight(); }
  void SetWake(std::function<void()> wake) override;
  bool TakeArrival() override { return inner_->TakeArrival(); }

  // Wakes if something held back is due, and returns when something will be. Any thread.
  sync::TimeNs Pump();

 private:
  struct InFlight {
    TransferType type = TransferType::kBulk;
    uint8_t endpoint = 0;
  };
  struct Held {
    sync::TimeNs due = 0;
    TransferCompletion completion;
  };

  void Run();
  // The plan's fault for this call or completion, the `count`-th of its kind.
  const TransportFault* Meet(TransportFault::Where where, uint64_t count);
  // The refusal of the next Submit, if there is one.
  absl::Status Refusal();
  absl::StatusOr<TransferId> Note(const InFlight& in_flight, absl::StatusOr<TransferId> id);
  void Take(TransferCompletion completion, std::vector<TransferCompletion>& out);

  const std::unique_ptr<UsbTransport> inner_;
  const std::vector<TransportFault> plan_;
  sync::Clock& clock_;

  // The owner's.
  uint64_t opens_ = 0, submits_ = 0, completions_ = 0, hits_ = 0;
  bool gone_ = false;
  std::map<TransferId, InFlight> in_flight_;
  std::map<uint8_t, std::deque<Held>> held_;  // by endpoint; 0: control
  std::vector<TransferCompletion> drained_;

  sync::Mutex mutex_;
  sync::CondVar work_;
  sync::TimeNs next_due_ VOXELD_GUARDED_BY(mutex_) = sync::kNever;  // of held_
  bool poked_ VOXELD_GUARDED_BY(mutex_) = false;
  bool stop_ VOXELD_GUARDED_BY(mutex_) = false;

  sync::Mutex wake_mutex_;  // held alone
  std::function<void()> wake_ VOXELD_GUARDED_BY(wake_mutex_);
  std::thread thread_;
};

}  // namespace voxeld::display
