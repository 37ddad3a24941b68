// A device opened through libusb: its transfers, its memory, and its shutdown.
//
// libusb calls back on the bus's event thread; completions wait here until the owner drains them.
// Everything that may wait in the kernel for the device (clearing a halt, a reset, cancelling a
// transfer, releasing the interface) runs on a thread of the device's own, so that neither its
// owner nor another device waits for it. Transfers that are submitted meanwhile are sent when it is
// done, because the kernel would otherwise make their owner wait too.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <thread>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "display/sync/clock.h"
#include "display/sync/mutex.h"
#include "display/usb/libusb/device_handle.h"
#include "display/usb/libusb/device_list.h"
#include "display/usb/libusb/usbfs_budget.h"
#include "display/usb/slab_memory.h"
#include "display/usb/usb_transport.h"

struct libusb_transfer;

namespace voxeld::display {

class OpenDevice {
 public:
  // Opens the device's node, and claims the interface; a kernel driver that holds it is detached
  // until the close. Errors: PermissionDenied, Unavailable (in use, or the device went away) or
  // Internal, each with a remedy. Ids begin at `first_id`. `wake` is called when there are
  // completions: with true while libusb handles events, when more may follow at once; with false by
  // the device's own thread. `budget` must outlive the device.
  static absl::StatusOr<std::unique_ptr<OpenDevice>> Open(std::shared_ptr<LibusbContext> context,
                                                          const UsbDeviceEntry& entry,
                                                          uint8_t interface, UsbfsBudget& budget,
                                                          sync::Clock& clock, TransferId first_id,
                                                          std::function<void(bool)> wake);
  // Requires: everything has ended.
  ~OpenDevice();
  OpenDevice(const OpenDevice&) = delete;
  OpenDevice& operator=(const OpenDevice&) = delete;

  const UsbDeviceEntry& entry() const { return entry_; }
  TransferId next_id() const;

  // As in UsbTransport.
  absl::StatusOr<TransferId> Submit(Transfer&& transfer);
  void Cancel(TransferId id);
  absl::StatusOr<TransferId> ClearHalt(uint8_t endpoint);
  absl::StatusOr<TransferId> Reset();
  size_t Drain(std::vector<TransferCompletion>& out);
  size_t bytes_in_flight() const;
  TransferBytes TakeBuffer(size_t capacity);

  // Accepts no more transfers, and stops calling `wake`. Lets requests end by themselves for
  // `patience`, then cancels everything and releases the interface. Waits for that until `limit`;
  // returns true if it has ended and may be destroyed.
  bool End(sync::TimeNs patience, sync::TimeNs limit);
  // After End: returns whether it has ended by now.
  bool Ended() const;

 private:
  struct Pending;
  struct Job {
    enum class What : uint8_t { kClearHalt, kReset, kCancel };
    What what = What::kClearHalt;
    TransferId id = 0;     // its own, or that of the transfer to cancel
    uint8_t endpoint = 0;  // kClearHalt
  };

  OpenDevice(std::shared_ptr<DeviceHandle> handle, const UsbDeviceEntry& entry, uint8_t interface,
             UsbfsBudget& budget, sync::Clock& clock, TransferId first_id,
             std::function<void(bool)> wake);

  static void OnDone(libusb_transfer* done);
  // For a transfer that libusb has finished, or never got.
  void Complete(Pending& pending, TransferStatus status);
  void Wake(bool more);
  absl::Status Refusal() const VOXELD_REQUIRES(mutex_);
  absl::Status SubmitLocked(Pending& pending) VOXELD_REQUIRES(mutex_);
  absl::StatusOr<TransferId> Queue(Job job);

  // Runs on the device's thread.
  void Work();
  void CarryOut(const Job& job);
  TransferStatus ResetPort(TransferId id);
  void CancelOne(TransferId id);
  void CancelBefore(TransferId end);
  void SubmitDeferred();
  void GiveBack();

  const std::shared_ptr<DeviceHandle> handle_;
  const UsbDeviceEntry entry_;
  const uint8_t interface_;
  UsbfsBudget& budget_;
  sync::Clock& clock_;
  std::shared_ptr<SlabMemory> memory_;  // the owner's; borrowed when first useful

  sync::Mutex wake_mutex_;
  std::function<void(bool)> wake_ VOXELD_GUARDED_BY(wake_mutex_);

  mutable sync::Mutex mutex_;
  sync::CondVar changed_;  // notified when a member below changes
  bool ending_ VOXELD_GUARDED_BY(mutex_) = false;
  bool ended_ VOXELD_GUARDED_BY(mutex_) = false;
  sync::TimeNs patient_until_ VOXELD_GUARDED_BY(mutex_) = 0;  // valid once ending_
  bool gone_ VOXELD_GUARDED_BY(mutex_) = false;
  TransferId next_id_ VOXELD_GUARDED_BY(mutex_);
  std::map<TransferId, Pending*> pending_ VOXELD_GUARDED_BY(mutex_);
  // those of pending_ that are not submitted yet
  std::deque<Pending*> deferred_ VOXELD_GUARDED_BY(mutex_);
  // allocated once and reused
  std::vector<std::unique_ptr<Pending>> all_ VOXELD_GUARDED_BY(mutex_);
  std::vector<Pending*> free_ VOXELD_GUARDED_BY(mutex_);
  size_t bytes_in_flight_ VOXELD_GUARDED_BY(mutex_) = 0;
  int finishing_ VOXELD_GUARDED_BY(mutex_) = 0;  // completions that are not reported yet
  std::vector<TransferCompletion> completions_ VOXELD_GUARDED_BY(mutex_);
  std::deque<Job> jobs_ VOXELD_GUARDED_BY(mutex_);  // the first is being executed
  std::thread thread_;
};

}  // namespace voxeld::display
