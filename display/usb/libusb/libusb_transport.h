// The transport to one device through libusb. Made by LibusbBus.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <vector>

#include "display/sync/mutex.h"
#include "display/usb/libusb/libusb_bus.h"
#include "display/usb/usb_transport.h"

namespace voxeld::display {

class LibusbTransport final : public UsbTransport {
 public:
  LibusbTransport(LibusbBus& bus, UsbMatch match);
  ~LibusbTransport() override;

  // Errors: NotFound while no device matches; else as OpenDevice::Open for the last one that was
  // tried.
  absl::Status Open() override;
  void Close() override;
  bool is_open() const override { return device_ != nullptr; }
  UsbIdentity identity() const override;
  absl::StatusOr<TransferId> Submit(Transfer&& transfer) override;
  void Cancel(TransferId id) override;
  absl::StatusOr<TransferId> ClearHalt(uint8_t endpoint) override;
  absl::StatusOr<TransferId> Reset() override;
  TransferBytes TakeBuffer(size_t capacity) override;
  size_t Drain(std::vector<TransferCompletion>& out) override;
  size_t bytes_in_flight() const override;
  size_t max_bytes_in_flight() const override { return bus_.max_bytes_in_flight(); }
  void SetWake(std::function<void()> wake) override;
  bool TakeArrival() override;

  // Called by the bus, from any thread.
  void Wake(bool arrival);
  // Called by the event thread: wakes the owner if it has unreported completions.
  void WakeIfDue();

 private:
  LibusbBus& bus_;
  const UsbMatch match_;
  std::unique_ptr<OpenDevice> device_;  // used by the owner's thread only
  TransferId next_id_ = 1;
  std::atomic<bool> due_ = false;

  sync::Mutex wake_mutex_;
  std::function<void()> wake_ VOXELD_GUARDED_BY(wake_mutex_);
  bool arrived_ VOXELD_GUARDED_BY(wake_mutex_) = false;
};

}  // namespace voxeld::display
