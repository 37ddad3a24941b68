#include "display/usb/libusb/usbfs_budget.h"

#include <fstream>
#include <utility>

#include "absl/strings/str_cat.h"

namespace voxeld::display {
namespace {

constexpr const char* kParameter = "/sys/module/usbcore/parameters/usbfs_memory_mb";
constexpr size_t kMiB = size_t{1} << 20;
constexpr size_t kDefaultMiB = 16;
constexpr size_t kUnlimited = size_t{1} << 30;  // more than any display can use

}  // namespace

size_t ReadUsbfsLimit() {
  size_t mebibytes = kDefaultMiB;
  std::ifstream file(kParameter);
  if (!(file >> mebibytes)) mebibytes = kDefaultMiB;
  if (mebibytes == 0 || mebibytes > kUnlimited / kMiB) return kUnlimited;
  return mebibytes * kMiB / 16 * 15;
}

std::string UsbfsLimitHint() {
  return absl::StrCat(
      "all programs together may have usbfs_memory_mb in flight; raise it with `echo 256 > ",
      kParameter, "`, for good with the kernel's parameter usbcore.usbfs_memory_mb=256");
}

UsbfsBudget::UsbfsBudget(size_t limit, std::function<void()> room)
    : limit_(limit), room_(std::move(room)) {}

bool UsbfsBudget::Take(size_t bytes) {
  sync::MutexLock lock(mutex_);
  if (bytes > limit_ - taken_) {
    refused_ = true;
    return false;
  }
  taken_ += bytes;
  return true;
}

void UsbfsBudget::Release(size_t bytes) {
  if (bytes == 0) return;
  {
    sync::MutexLock lock(mutex_);
    taken_ -= bytes;
    if (!std::exchange(refused_, false)) return;
  }
  room_();
}

bool UsbfsBudget::TakeLent(size_t bytes) {
  sync::MutexLock lock(mutex_);
  if (bytes > limit_ / 2 - lent_ || bytes > limit_ - taken_) return false;
  lent_ += bytes;
  taken_ += bytes;
  return true;
}

void UsbfsBudget::ReleaseLent(size_t bytes) {
  {
    sync::MutexLock lock(mutex_);
    lent_ -= bytes;
  }
  Release(bytes);
}

}  // namespace voxeld::display
