// libusb's context, and its handle of a device with the memory that the kernel lends for transfers.
#pragma once

#include <cstddef>
#include <memory>

#include "absl/status/statusor.h"
#include "display/usb/libusb/usbfs_budget.h"
#include "display/usb/slab_memory.h"

struct libusb_context;
struct libusb_device_handle;

namespace voxeld::display {

// Does not use libusb's own device discovery, which would parse the descriptors of every attached
// device.
class LibusbContext {
 public:
  static absl::StatusOr<std::shared_ptr<LibusbContext>> Make();
  ~LibusbContext();
  LibusbContext(const LibusbContext&) = delete;
  LibusbContext& operator=(const LibusbContext&) = delete;
  libusb_context* get() const { return context_; }

 private:
  explicit LibusbContext(libusb_context* context) : context_(context) {}
  libusb_context* const context_;
};

// Closes the device in its destructor.
class DeviceHandle {
 public:
  // `node` is the descriptor that `handle` was made from.
  DeviceHandle(std::shared_ptr<LibusbContext> context, libusb_device_handle* handle, int node);
  ~DeviceHandle();
  DeviceHandle(const DeviceHandle&) = delete;
  DeviceHandle& operator=(const DeviceHandle&) = delete;

  libusb_device_handle* get() const { return handle_; }
  // Returns whether the kernel lends memory: libusb would map the node without checking.
  bool gives_memory() const;

 private:
  const std::shared_ptr<LibusbContext> context_;
  libusb_device_handle* const handle_;
  const int node_;
};

inline constexpr size_t kSlabBytes = size_t{256} << 10;

// Returns slabs of memory that the kernel reads in place, as many as kernel and budget allow, and
// ordinary memory for the rest. Keeps the handle; `budget` must outlive the result.
std::shared_ptr<SlabMemory> BorrowSlabs(std::shared_ptr<DeviceHandle> handle, UsbfsBudget& budget);

}  // namespace voxeld::display
