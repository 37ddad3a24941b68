// A device that libusb has open: its transfers, its memory, its way to close.
//
// libusb calls back on the bus's event thread; completions wait here until their owner drains them.
// Whatever may wait in the kernel for the device (clearing a halt, a reset, cancelling a transfer,
// giving the interface back) is done by a thread of the device's own: neither its owner nor
// another device waits for it. Transfers that are submitted meanwhile go out when it is done, for the
// kernel would have their owner wait too.
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
  // Opens the device's node, and claims the interface; a kernel's driver that has it is detached
  // until the close. PermissionDenied, Unavailable (somebody else has it; it went away) or Internal,
  // each with what would help. Ids begin at `first_id`. `wake`
  // is called when there are completions: with true while libusb handles events, when more may follow
  // at once, with false by the device's own thread. `budget` outlives the device.
  static absl::StatusOr<std::unique_ptr<OpenDevice>> Open(std::shared_ptr<LibusbContext> context,
                                                          const UsbDeviceEntry& entry,
                                                          uint8_t interface, UsbfsBudget& budget,
                                                          sync::Clock& clock, TransferId first_id,
                                                          std::function<void(bool)> wake);
  // Everything must have ended.
  ~OpenDevice();
  OpenDevice(const OpenDevice&) = delete;
  OpenDevice& operator=(const OpenDevice&) = delete;

  const UsbDeviceEntry& entry() const { return entry_; }
  TransferId next_id() const;

  // As UsbTransport's.
  absl::StatusOr<TransferId> Submit(Transfer&& transfer);
  void Cancel(TransferId id);
  absl::StatusOr<TransferId> ClearHalt(uint8_t endpoint);
  absl::StatusOr<TransferId> Reset();
  size_t Drain(std::vector<TransferCompletion>& out);
  size_t bytes_in_flight() const;
  TransferBytes TakeBuffer(size_t capacity);

  // No transfer is taken any more, and `wake` is not called again. Requests get `patience` to end by
  // themselves, then all is cancelled, and the interface is given back. Waits for that until `limit`;
  // true: it has ended and may be destroyed.
  bool End(sync::TimeNs patience, sync::TimeNs limit);
  // After End: has it ended by now?
  bool Ended() const;

 private:
  struct Pending;
  struct Job {
    enum class What : uint8_t { kClearHalt, kReset, kCancel };
    What what = What::kClearHalt;
    TransferId id = 0;     // its own, or of the transfer to cancel
    uint8_t endpoint = 0;  // kClearHalt
  };

  OpenDevice(std::shared_ptr<DeviceHandle> handle, const UsbDeviceEntry& entry, uint8_t interface,
             UsbfsBudget& budget, sync::Clock& clock, TransferId first_id,
             std::function<void(bool)> wake);

  static void OnDone(libusb_transfer* done);
  // Of a transfer that libusb is done with, or never had.
  void Complete(Pending& pending, TransferStatus status);
  void Wake(bool more);
  absl::Status Refusal() const VOXELD_REQUIRES(mutex_);
  absl::Status SubmitLocked(Pending& pending) VOXELD_REQUIRES(mutex_);
  absl::StatusOr<TransferId> Queue(Job job);

  // The device's thread.
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
  std::shared_ptr<SlabMemory> memory_;  // the owner's; borrowed when it is first of use

  sync::Mutex wake_mutex_;
  std::function<void(bool)> wake_ VOXELD_GUARDED_BY(wake_mutex_);

  mutable sync::Mutex mutex_;
  sync::CondVar changed_;  // something of what follows
  bool ending_ VOXELD_GUARDED_BY(mutex_) = false;
  bool ended_ VOXELD_GUARDED_BY(mutex_) = false;
  sync::TimeNs patient_until_ VOXELD_GUARDED_BY(mutex_) = 0;  // once ending_
  bool gone_ VOXELD_GUARDED_BY(mutex_) = false;
  TransferId next_id_ VOXELD_GUARDED_BY(mutex_);
  std::map<TransferId, Pending*> pending_ VOXELD_GUARDED_BY(mutex_);
  std::deque<Pending*> deferred_ VOXELD_GUARDED_BY(mutex_);  // of these, those not submitted yet
  std::vector<std::unique_ptr<Pending>> all_ VOXELD_GUARDED_BY(mutex_);  // made once, used again
  std::vector<Pending*> free_ VOXELD_GUARDED_BY(mutex_);
  size_t bytes_in_flight_ VOXELD_GUARDED_BY(mutex_) = 0;
  int finishing_ VOXELD_GUARDED_BY(mutex_) = 0;  // completions that are not told of yet
  std::vector<TransferCompletion> completions_ VOXELD_GUARDED_BY(mutex_);
  std::deque<Job> jobs_ VOXELD_GUARDED_BY(mutex_);  // the first is being carried out
  std::thread thread_;
};

}  // namespace voxeld::display
