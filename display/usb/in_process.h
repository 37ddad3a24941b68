// A USB transport whose device is a model in this process. It is as asynchronous as a real one:
// Submit only queues, and everything that the device does happens on the transport's own event
// thread or, for tests and single-threaded simulations of whole systems, when Pump is called.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <thread>
#include <variant>
#include <vector>

#include "display/sync/clock.h"
#include "display/sync/mutex.h"
#include "display/usb/device_model.h"
#include "display/usb/usb_transport.h"

namespace voxeld::display {

class InProcessTransport final : public UsbTransport {
 public:
  struct Options {
    bool own_thread = true;  // false: the owner calls Pump
    // As in Linux's usbfs, which answers "out of memory" beyond.
    size_t max_bytes_in_flight = size_t{16} << 20;
    UsbIdentity identity{.vendor_id = 0x1209,
                         .product_id = 0x0001,
                         .bcd_device = 0x0100,
                         .serial = "simulated",
                         .path = "in-process"};
  };

  InProcessTransport(std::unique_ptr<UsbDeviceModel> device, sync::Clock& clock, Options options);
  ~InProcessTransport() override;

  absl::Status Open() override;
  void Close() override;
  bool is_open() const override;
  UsbIdentity identity() const override { return options_.identity; }
  absl::StatusOr<TransferId> Submit(Transfer&& transfer) override;
  void Cancel(TransferId id) override;
  absl::StatusOr<TransferId> ClearHalt(uint8_t endpoint) override;
  absl::StatusOr<TransferId> Reset() override;
  TransferBytes TakeBuffer(size_t capacity) override;
  size_t Drain(std::vector<TransferCompletion>& out) override;
  size_t bytes_in_flight() const override;
  size_t max_bytes_in_flight() const override { return options_.max_bytes_in_flight; }
  void SetWake(std::function<void()> wake) override;
  bool TakeArrival() override;

  // Passes submitted transfers to the device, lets it do what is due, and returns when to call it
  // again. Any thread; the event thread runs this in a loop.
  sync::TimeNs Pump();

  // Runs `function` with exclusive access to the device (for a test to see what it shows, or to
  // unplug it).
  void WithDevice(const std::function<void(UsbDeviceModel&)>& function);

 private:
  struct Request {
    TransferId id = 0;
    Transfer transfer;
    bool reset = false;  // instead of a transfer
  };
  struct Pending {
    Transfer transfer;
    sync::TimeNs deadline = sync::kNever;
  };

  void Run();
  void Give(Request request) VOXELD_REQUIRES(device_mutex_);
  void ExpireTimeouts(sync::TimeNs now) VOXELD_REQUIRES(device_mutex_);
  void OnComplete(uint64_t id, TransferStatus status, uint32_t actual,
                  std::span<const std::byte> in) VOXELD_REQUIRES(device_mutex_);
  void CallWake();
  absl::StatusOr<TransferId> Queue(Transfer&& transfer, bool reset = false);

  sync::Clock& clock_;
  const Options options_;

  // Lock order: device_mutex_ before mutex_. wake_mutex_ is never held together with another.
  mutable sync::Mutex device_mutex_;
  // The pointer is constant; the model is guarded by device_mutex_.
  std::unique_ptr<UsbDeviceModel> device_;
  std::map<TransferId, Pending> pending_ VOXELD_GUARDED_BY(device_mutex_);
  bool was_plugged_ VOXELD_GUARDED_BY(device_mutex_) = false;
  uint32_t seen_plugs_ VOXELD_GUARDED_BY(device_mutex_) = 0;

  mutable sync::Mutex mutex_;
  sync::CondVar work_;
  bool open_ VOXELD_GUARDED_BY(mutex_) = false;
  bool gone_ VOXELD_GUARDED_BY(mutex_) = false;  // the device that was opened is gone
  bool stop_ VOXELD_GUARDED_BY(mutex_) = false;
  bool poked_ VOXELD_GUARDED_BY(mutex_) = false;  // the device's next timeout may have changed
  bool arrived_ VOXELD_GUARDED_BY(mutex_) = false;
  TransferId next_id_ VOXELD_GUARDED_BY(mutex_) = 1;
  // an id means: cancel
  std::deque<std::variant<Request, TransferId>> requests_ VOXELD_GUARDED_BY(mutex_);
  std::vector<TransferCompletion> completions_ VOXELD_GUARDED_BY(mutex_);
  size_t bytes_in_flight_ VOXELD_GUARDED_BY(mutex_) = 0;

  const std::shared_ptr<TransferMemory> memory_;

  sync::Mutex wake_mutex_;
  std::function<void()> wake_ VOXELD_GUARDED_BY(wake_mutex_);

  std::thread thread_;
};

}  // namespace voxeld::display
