#include "display/usb/libusb/libusb_transport.h"

#include <utility>

namespace voxeld::display {

LibusbTransport::LibusbTransport(LibusbBus& bus, UsbMatch match)
    : bus_(bus), match_(std::move(match)) {}

LibusbTransport::~LibusbTransport() {
  Close();
  bus_.Forget(this);
}

absl::Status LibusbTransport::Open() {
  if (device_ != nullptr) return absl::FailedPreconditionError("the device is open already");
  {
    sync::MutexLock lock(wake_mutex_);
    arrived_ = false;
  }
  absl::StatusOr<std::unique_ptr<OpenDevice>> device =
      bus_.Open(match_, next_id_, [this](bool more) {
        if (more) {
          due_ = true;
        } else {
          Wake(false);
        }
      });
  if (!device.ok()) return device.status();
  device_ = *std::move(device);
  return absl::OkStatus();
}

void LibusbTransport::Close() {
  if (device_ == nullptr) return;
  next_id_ = device_->next_id();
  bus_.Close(std::move(device_));
}

UsbIdentity LibusbTransport::identity() const {
  if (device_ != nullptr) return device_->entry().identity;
  return {.vendor_id = match_.vendor_id.value_or(0),
          .product_id = match_.product_id.value_or(0),
          .serial = match_.serial,
          .path = match_.path.empty() ? "not attached" : match_.path};
}

absl::StatusOr<TransferId> LibusbTransport::Submit(Transfer&& transfer) {
  if (device_ == nullptr) return absl::FailedPreconditionError("the device is not open");
  return device_->Submit(std::move(transfer));
}

void LibusbTransport::Cancel(TransferId id) {
  if (device_ != nullptr) device_->Cancel(id);
}

absl::StatusOr<TransferId> LibusbTransport::ClearHalt(uint8_t endpoint) {
  if (device_ == nullptr) return absl::FailedPreconditionError("the device is not open");
  return device_->ClearHalt(endpoint);
}

absl::StatusOr<TransferId> LibusbTransport::Reset() {
  if (device_ == nullptr) return absl::FailedPreconditionError("the device is not open");
  return device_->Reset();
}

TransferBytes LibusbTransport::TakeBuffer(size_t capacity) {
  if (device_ != nullptr) return device_->TakeBuffer(capacity);
  TransferBytes buffer;
  buffer.reserve(capacity);
  return buffer;
}

size_t LibusbTransport::Drain(std::vector<TransferCompletion>& out) {
  return device_ == nullptr ? 0 : device_->Drain(out);
}

size_t LibusbTransport::bytes_in_flight() const {
  return device_ == nullptr ? 0 : device_->bytes_in_flight();
}

void LibusbTransport::SetWake(std::function<void()> wake) {
  sync::MutexLock lock(wake_mutex_);
  wake_ = std::move(wake);
}

bool LibusbTransport::TakeArrival() {
  sync::MutexLock lock(wake_mutex_);
  return std::exchange(arrived_, false) && device_ == nullptr;
}

void LibusbTransport::Wake(bool arrival) {
  sync::MutexLock lock(wake_mutex_);
  arrived_ = arrived_ || arrival;
  if (wake_) wake_();
}

void LibusbTransport::WakeIfDue() {
  if (due_.exchange(false)) Wake(false);
}

}  // namespace voxeld::display
