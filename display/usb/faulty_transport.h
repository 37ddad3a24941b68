// A transport that fails as real ones do, where a plan says so: it refuses calls, and delays or
// changes completions. The wrapped transport works normally: a transfer whose completion is
// replaced has still taken place.
//
// Deterministic: the plan, the order of calls and a clock determine everything. For faults of the
// cable and of the device see emulator/fault_injector.h.
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
    kSubmit,      // also counts ClearHalt and Reset
    kCompletion,  // in the order in which they happen
  };
  Where where = Where::kSubmit;
  uint64_t at = 1;     // which of them, from 1, since the transport was made
  uint64_t count = 1;  // so many in a row
  // kOpen, kSubmit: the error returned; the wrapped transport is not called.
  absl::Status refusal = absl::UnavailableError("a fault was planned here");
  // kCompletion: the status reported instead. An IN transfer keeps actual_length of its bytes, or
  // none if that is not set and `status` is neither kOk nor kShort. kDisconnected also ends
  // everything else in flight, and lasts until Close.
  std::optional<TransferStatus> status;
  std::optional<uint32_t> actual_length;  // the length reported, true or not
  // kCompletion: delay of the completion; later ones on its endpoint do not overtake it.
  sync::TimeNs hold = 0;
};

class FaultyTransport final : public UsbTransport {
 public:
  struct Options {
    bool own_thread = true;  // wakes for delayed completions; false: the owner calls Pump
  };

  FaultyTransport(std::unique_ptr<UsbTransport> inner, std::vector<TransportFault> plan,
                  sync::Clock& clock, Options options);
  ~FaultyTransport() override;

  // Returns how many calls and completions had a fault.
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

  // Wakes if a delayed completion is due, and returns when the next one will be. Any thread.
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
  // Returns the plan's fault for this call or completion, the `count`-th of its kind; null if none.
  const TransportFault* Meet(TransportFault::Where where, uint64_t count);
  // Returns the error for the next Submit, if one is planned.
  absl::Status Refusal();
  absl::StatusOr<TransferId> Note(const InFlight& in_flight, absl::StatusOr<TransferId> id);
  void Take(TransferCompletion completion, std::vector<TransferCompletion>& out);

  const std::unique_ptr<UsbTransport> inner_;
  const std::vector<TransportFault> plan_;
  sync::Clock& clock_;

  // Used by the owner's thread only.
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

  sync::Mutex wake_mutex_;  // never held together with another lock
  std::function<void()> wake_ VOXELD_GUARDED_BY(wake_mutex_);
  std::thread thread_;
};

}  // namespace voxeld::display
