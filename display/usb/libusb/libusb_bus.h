// The machine's USB through libusb 1.0 and udev: one context, one event thread for all devices.
#pragma once

#include <atomic>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "absl/status/statusor.h"
#include "display/sync/clock.h"
#include "display/sync/mutex.h"
#include "display/usb/libusb/open_device.h"
#include "display/usb/usb_bus.h"

struct pollfd;

namespace voxeld::display {

class LibusbTransport;

class LibusbBus final : public UsbBus {
 public:
  // Errors: Unavailable if the system has no USB at all. `clock` must outlive the bus and be a real
  // one.
  static absl::StatusOr<std::unique_ptr<LibusbBus>> Make(sync::Clock& clock);
  // Requires: all transports are destroyed. Stops the event thread when all their devices have
  // ended.
  ~LibusbBus() override;

  std::unique_ptr<UsbTransport> MakeTransport(UsbMatch match) override;

  // For use by LibusbTransport.
  absl::StatusOr<std::unique_ptr<OpenDevice>> Open(const UsbMatch& match, TransferId first_id,
                                                   std::function<void(bool)> wake);
  void Close(std::unique_ptr<OpenDevice> device);
  void Forget(LibusbTransport* transport);
  size_t max_bytes_in_flight() const { return budget_.limit(); }

 private:
  LibusbBus(std::shared_ptr<LibusbContext> context, std::unique_ptr<DeviceList> list,
            std::unique_ptr<DeviceWatch> watch, int poke, sync::Clock& clock);

  // Reserves for the caller a device that matches, is not in use, and is not among the nodes
  // `tried`.
  absl::StatusOr<UsbDeviceEntry> Reserve(const UsbMatch& match, const std::set<std::string>& tried);

  void Run();
  // Returns our descriptors (PollIndex), then libusb's.
  std::vector<pollfd> PollFds() const;
  void FdsChanged();
  void Poke() const;
  void WakeAll(bool arrival);
  // Wakes the transports whose completions have arrived since.
  void WakeDue();
  // Destroys the devices that have ended since; returns true if some are left.
  bool Bury();

  const std::shared_ptr<LibusbContext> context_;
  // used by the event thread; null: no events, only scans
  const std::unique_ptr<DeviceWatch> watch_;
  const int poke_;  // eventfd
  sync::Clock& clock_;
  std::atomic<bool> fds_changed_ = true;  // which descriptors libusb wants polled
  UsbfsBudget budget_;

  sync::Mutex list_mutex_;
  const std::unique_ptr<DeviceList> list_;  // guarded by list_mutex_
  // Open nodes, and the group that each belongs to (UsbMatch::Member), if any.
  std::map<std::string, std::string> open_nodes_ VOXELD_GUARDED_BY(list_mutex_);

  sync::Mutex transports_mutex_;
  std::set<LibusbTransport*> transports_ VOXELD_GUARDED_BY(transports_mutex_);

  sync::Mutex graves_mutex_;
  std::vector<std::unique_ptr<OpenDevice>> graves_ VOXELD_GUARDED_BY(graves_mutex_);
  bool stop_ VOXELD_GUARDED_BY(graves_mutex_) = false;

  std::thread thread_;
};

}  // namespace voxeld::display
