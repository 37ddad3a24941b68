#include "display/usb/libusb/device_handle.h"

#include <libusb-1.0/libusb.h>
#include <linux/usbdevice_fs.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"

namespace voxeld::display {
namespace {

// more than a driver has in flight, so that it can fill some meanwhile
constexpr size_t kSlabs = 24;

class DeviceSlabs final : public SlabMemory {
 public:
  DeviceSlabs(std::shared_ptr<DeviceHandle> handle, UsbfsBudget& budget, std::vector<void*> slabs)
      : SlabMemory(slabs, kSlabBytes),
        handle_(std::move(handle)),
        budget_(budget),
        slabs_(std::move(slabs)) {}
  ~DeviceSlabs() override {
    for (void* slab : slabs_) {
      libusb_dev_mem_free(handle_->get(), static_cast<unsigned char*>(slab), kSlabBytes);
    }
    budget_.ReleaseLent(slabs_.size() * kSlabBytes);
  }

 private:
  const std::shared_ptr<DeviceHandle> handle_;
  UsbfsBudget& budget_;
  const std::vector<void*> slabs_;
};

}  // namespace

absl::StatusOr<std::shared_ptr<LibusbContext>> LibusbContext::Make() {
  libusb_set_option(nullptr, LIBUSB_OPTION_NO_DEVICE_DISCOVERY);
  libusb_context* context = nullptr;
  if (const int result = libusb_init(&context); result != 0) {
    return absl::UnavailableError(absl::StrCat("libusb: ", libusb_error_name(result)));
  }
  return std::shared_ptr<LibusbContext>(new LibusbContext(context));
}

LibusbContext::~LibusbContext() { libusb_exit(context_); }

DeviceHandle::DeviceHandle(std::shared_ptr<LibusbContext> context, libusb_device_handle* handle,
                           int node)
    : context_(std::move(context)), handle_(handle), node_(node) {}

DeviceHandle::~DeviceHandle() {
  libusb_close(handle_);
  close(node_);
}

bool DeviceHandle::gives_memory() const {
  uint32_t capabilities = 0;
  return ioctl(node_, USBDEVFS_GET_CAPABILITIES, &capabilities) == 0 &&
         (capabilities & USBDEVFS_CAP_MMAP) != 0;
}

std::shared_ptr<SlabMemory> BorrowSlabs(std::shared_ptr<DeviceHandle> handle, UsbfsBudget& budget) {
  std::vector<void*> slabs;
  // The kernel counts them as long as they exist.
  while (handle->gives_memory() && slabs.size() < kSlabs && budget.TakeLent(kSlabBytes)) {
    void* const slab = libusb_dev_mem_alloc(handle->get(), kSlabBytes);
    if (slab == nullptr) {
      budget.ReleaseLent(kSlabBytes);
      break;
    }
    slabs.push_back(slab);
  }
  return std::make_shared<DeviceSlabs>(std::move(handle), budget, std::move(slabs));
}

}  // namespace voxeld::display
