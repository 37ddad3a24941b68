#include "display/usb/libusb/open_device.h"

#include <fcntl.h>
#include <libusb-1.0/libusb.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <exception>
#include <limits>
#include <new>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "display/usb/libusb/transfer_status.h"

namespace voxeld::display {
namespace {

constexpr size_t kTransfers = 64;  // allocated at once; more as needed
// How long Reset waits for transfers in flight after their cancellation.
constexpr sync::TimeNs kCancelLimit = sync::kSecond;

std::string NameOf(const UsbDeviceEntry& entry) {
  return absl::StrCat(entry.node, " (at ", entry.identity.path, ")");
}

// Converts to libusb's milliseconds; 0 means no timeout.
unsigned Milliseconds(sync::TimeNs timeout) {
  if (timeout <= 0) return 0;
  return static_cast<unsigned>(std::max<sync::TimeNs>(timeout / sync::kMillisecond, 1));
}

}  // namespace

struct OpenDevice::Pending {
  Pending() : transfer(libusb_alloc_transfer(0)) {
    if (transfer == nullptr) throw std::bad_alloc();
  }
  ~Pending() { libusb_free_transfer(transfer); }
  Pending(const Pending&) = delete;
  Pending& operator=(const Pending&) = delete;

  libusb_transfer* const transfer;
  OpenDevice* device = nullptr;
  TransferId id = 0;
  Transfer asked;
  std::vector<unsigned char> bytes;  // for requests, and incoming data
  size_t counted = 0;                // bytes counted in the budget
  // It must not be reused while libusb is asked to cancel it.
  bool cancelling = false, done = false;
};

absl::StatusOr<std::unique_ptr<OpenDevice>> OpenDevice::Open(
    std::shared_ptr<LibusbContext> context, const UsbDeviceEntry& entry, uint8_t interface,
    UsbfsBudget& budget, sync::Clock& clock, TransferId first_id, std::function<void(bool)> wake) {
  const int node = open(entry.node.c_str(), O_RDWR | O_CLOEXEC);
  if (node < 0) {
    const int error = errno;
    const std::string what =
        absl::StrCat(NameOf(entry), " cannot be opened: ", std::generic_category().message(error));
    if (error != EACCES && error != EPERM) return absl::UnavailableError(what);
    return absl::PermissionDeniedError(
        absl::StrCat(what,
                     "; the udev rules of voxeld let in the group voxeld and whoever sits at "
                     "the machine (packaging/70-voxeld.rules)"));
  }
  libusb_device_handle* raw = nullptr;
  if (const int result = libusb_wrap_sys_device(context->get(), node, &raw); result != 0) {
    close(node);
    return absl::UnavailableError(
        absl::StrCat(NameOf(entry), " cannot be used: ", libusb_error_name(result)));
  }
  auto handle = std::make_shared<DeviceHandle>(std::move(context), raw, node);
  libusb_set_auto_detach_kernel_driver(raw, 1);
  int configuration = 0;
  if (libusb_get_configuration(raw, &configuration) == 0 && configuration == 0) {
    if (const int result = libusb_set_configuration(raw, 1); result != 0) {
      return absl::UnavailableError(
          absl::StrCat(NameOf(entry), " cannot be configured: ", libusb_error_name(result)));
    }
  }
  if (const int result = libusb_claim_interface(raw, interface); result != 0) {
    return absl::UnavailableError(absl::StrCat(
        "interface ", interface, " of ", NameOf(entry), " cannot be claimed: ",
        result == LIBUSB_ERROR_BUSY ? "another program has it" : libusb_error_name(result)));
  }
  try {
    return std::unique_ptr<OpenDevice>(new OpenDevice(std::move(handle), entry, interface, budget,
                                                      clock, first_id, std::move(wake)));
  } catch (const std::exception& error) {
    return absl::UnavailableError(
        absl::StrCat("no thread or memory for ", NameOf(entry), ": ", error.what()));
  }
}

OpenDevice::OpenDevice(std::shared_ptr<DeviceHandle> handle, const UsbDeviceEntry& entry,
                       uint8_t interface, UsbfsBudget& budget, sync::Clock& clock,
                       TransferId first_id, std::function<void(bool)> wake)
    : handle_(std::move(handle)),
      entry_(entry),
      interface_(interface),
      budget_(budget),
      clock_(clock),
      wake_(std::move(wake)),
      next_id_(first_id) {
  for (size_t i = 0; i < kTransfers; ++i) {
    all_.push_back(std::make_unique<Pending>());
    free_.push_back(all_.back().get());
  }
  thread_ = std::thread([this] { Work(); });
}

OpenDevice::~OpenDevice() {
  {
    sync::MutexLock lock(mutex_);
    ending_ = true;
    changed_.NotifyAll();
  }
  thread_.join();
}

// ---- transfers

absl::Status OpenDevice::Refusal() const {
  if (ending_) return absl::FailedPreconditionError("the device is not open");
  if (gone_) return absl::UnavailableError("the device was unplugged");
  return absl::OkStatus();
}

absl::StatusOr<TransferId> OpenDevice::Submit(Transfer&& transfer) {
  sync::MutexLock lock(mutex_);
  if (absl::Status refusal = Refusal(); !refusal.ok()) return refusal;
  const size_t size = std::max<size_t>(transfer.data.size(), transfer.length);
  const bool in_place = transfer.length == 0 && !transfer.data.empty() &&
                        transfer.type != TransferType::kControl && memory_ != nullptr &&
                        memory_->Owns(transfer.data.data());
  const size_t counted = in_place ? 0 : size;
  if (!budget_.Take(counted)) {
    return absl::ResourceExhaustedError(absl::StrCat(size, " bytes more do not fit into the ",
                                                     budget_.limit(), " that may be in flight; ",
                                                     UsbfsLimitHint()));
  }
  if (free_.empty()) {
    all_.push_back(std::make_unique<Pending>());
    free_.push_back(all_.back().get());
  }
  Pending& pending = *free_.back();
  pending.device = this;
  pending.id = next_id_;
  pending.asked = std::move(transfer);
  pending.counted = counted;
  pending.transfer->actual_length = 0;
  if (!jobs_.empty() || !deferred_.empty()) {
    deferred_.push_back(&pending);
  } else if (absl::Status status = SubmitLocked(pending); !status.ok()) {
    transfer = std::move(pending.asked);
    budget_.Release(counted);
    return status;
  }
  free_.pop_back();
  bytes_in_flight_ += size;
  pending_[next_id_] = &pending;
  return next_id_++;
}

absl::Status OpenDevice::SubmitLocked(Pending& pending) {
  const Transfer& asked = pending.asked;
  libusb_transfer* const transfer = pending.transfer;
  transfer->flags = 0;
  const auto callback = [](libusb_transfer* done) { OnDone(done); };
  const unsigned timeout = Milliseconds(asked.timeout);
  if (asked.type == TransferType::kControl) {
    const bool in = (asked.setup.request_type & LIBUSB_ENDPOINT_IN) != 0;
    const size_t length = in ? asked.length : asked.data.size();
    pending.bytes.resize(LIBUSB_CONTROL_SETUP_SIZE + length);
    libusb_fill_control_setup(pending.bytes.data(), asked.setup.request_type, asked.setup.request,
                              asked.setup.value, asked.setup.index, static_cast<uint16_t>(length));
    if (!in && length > 0) {
      std::memcpy(pending.bytes.data() + LIBUSB_CONTROL_SETUP_SIZE, asked.data.data(), length);
    }
    libusb_fill_control_transfer(transfer, handle_->get(), pending.bytes.data(), callback, &pending,
                                 timeout);
  } else {
    unsigned char* bytes = nullptr;
    size_t length = asked.data.size();
    if ((asked.endpoint & LIBUSB_ENDPOINT_IN) != 0) {
      length = asked.length;
      pending.bytes.resize(length);
      bytes = pending.bytes.data();
    } else {
      bytes = reinterpret_cast<unsigned char*>(pending.asked.data.data());
      if (asked.zero_packet) transfer->flags |= LIBUSB_TRANSFER_ADD_ZERO_PACKET;
    }
    libusb_fill_bulk_transfer(transfer, handle_->get(), asked.endpoint, bytes,
                              static_cast<int>(length), callback, &pending, timeout);
    if (asked.type == TransferType::kInterrupt) transfer->type = LIBUSB_TRANSFER_TYPE_INTERRUPT;
  }
  const int result = libusb_submit_transfer(transfer);
  switch (result) {
    case 0:
      return absl::OkStatus();
    case LIBUSB_ERROR_NO_DEVICE:
      gone_ = true;
      return absl::UnavailableError("the device was unplugged");
    case LIBUSB_ERROR_NO_MEM:
      return absl::ResourceExhaustedError(
          absl::StrCat("the kernel takes no more transfers; ", UsbfsLimitHint()));
    default:
      return absl::InternalError(absl::StrCat("a transfer of ", transfer->length,
                                              " bytes on endpoint ", asked.endpoint, ": ",
                                              libusb_error_name(result)));
  }
}

void OpenDevice::OnDone(libusb_transfer* done) {
  auto& pending = *static_cast<Pending*>(done->user_data);
  pending.device->Complete(pending, StatusOf(*done));
}

void OpenDevice::Complete(Pending& pending, TransferStatus status) {
  {
    sync::MutexLock lock(mutex_);
    pending_.erase(pending.id);
    ++finishing_;
  }
  const libusb_transfer& done = *pending.transfer;
  TransferCompletion completion;
  completion.id = pending.id;
  completion.type = pending.asked.type;
  completion.endpoint = pending.asked.endpoint;
  completion.status = status;
  completion.actual_length = static_cast<uint32_t>(std::max(done.actual_length, 0));
  if (pending.asked.length > 0 && completion.actual_length == 0) {
    // No data came, or the transfer was never sent.
  } else if (pending.asked.length > 0) {
    const size_t head =
        pending.asked.type == TransferType::kControl ? LIBUSB_CONTROL_SETUP_SIZE : 0;
    completion.data = TransferBytes(
        std::as_bytes(std::span(pending.bytes))
            .subspan(head, std::min<size_t>(completion.actual_length, pending.asked.length)));
  } else {
    completion.data = std::move(pending.asked.data);
    // How much was sent before the timeout is unknown: host controllers differ.
    if (completion.status == TransferStatus::kTimedOut) completion.actual_length = 0;
  }
  const size_t size = std::max<size_t>(pending.asked.length, completion.data.size());
  const size_t counted = std::exchange(pending.counted, 0);
  pending.asked = Transfer{};
  {
    sync::MutexLock lock(mutex_);
    if (completion.status == TransferStatus::kDisconnected) gone_ = true;
    if (pending.cancelling) {
      pending.done = true;
    } else {
      free_.push_back(&pending);
    }
    bytes_in_flight_ -= size;
    completions_.push_back(std::move(completion));
  }
  budget_.Release(counted);
  Wake(true);
  sync::MutexLock lock(mutex_);
  --finishing_;
  changed_.NotifyAll();
}

void OpenDevice::Wake(bool more) {
  sync::MutexLock lock(wake_mutex_);
  if (wake_) wake_(more);
}

void OpenDevice::Cancel(TransferId id) {
  sync::MutexLock lock(mutex_);
  if (!pending_.contains(id)) return;
  jobs_.push_back({.what = Job::What::kCancel, .id = id});
  changed_.NotifyAll();
}

size_t OpenDevice::Drain(std::vector<TransferCompletion>& out) {
  sync::MutexLock lock(mutex_);
  const size_t count = completions_.size();
  std::move(completions_.begin(), completions_.end(), std::back_inserter(out));
  completions_.clear();
  return count;
}

TransferId OpenDevice::next_id() const {
  sync::MutexLock lock(mutex_);
  return next_id_;
}

size_t OpenDevice::bytes_in_flight() const {
  sync::MutexLock lock(mutex_);
  return bytes_in_flight_;
}

TransferBytes OpenDevice::TakeBuffer(size_t capacity) {
  // Do not borrow slabs for buffers that would not lie in one.
  if (memory_ == nullptr && capacity > kSlabBytes / 2) memory_ = BorrowSlabs(handle_, budget_);
  TransferBytes buffer(memory_);
  buffer.reserve(capacity);
  return buffer;
}

// ---- calls that may wait in the kernel

absl::StatusOr<TransferId> OpenDevice::ClearHalt(uint8_t endpoint) {
  return Queue({.what = Job::What::kClearHalt, .endpoint = endpoint});
}

absl::StatusOr<TransferId> OpenDevice::Reset() { return Queue({.what = Job::What::kReset}); }

absl::StatusOr<TransferId> OpenDevice::Queue(Job job) {
  sync::MutexLock lock(mutex_);
  if (absl::Status refusal = Refusal(); !refusal.ok()) return refusal;
  job.id = next_id_++;
  jobs_.push_back(job);
  changed_.NotifyAll();
  return job.id;
}

void OpenDevice::Work() {
  while (true) {
    Job job;
    {
      sync::MutexLock lock(mutex_);
      while (jobs_.empty() && !ending_) changed_.Wait(mutex_);
      if (jobs_.empty() || ending_) break;
      job = jobs_.front();
    }
    CarryOut(job);
  }
  GiveBack();
}

void OpenDevice::CarryOut(const Job& job) {
  TransferCompletion completion;
  completion.id = job.id;
  completion.type = TransferType::kControl;
  switch (job.what) {
    case Job::What::kClearHalt:
      completion.status = StatusOf(libusb_clear_halt(handle_->get(), job.endpoint));
      break;
    case Job::What::kReset:
      completion.status = ResetPort(job.id);
      break;
    case Job::What::kCancel:
      CancelOne(job.id);
      break;
  }
  {
    sync::MutexLock lock(mutex_);
    if (job.what != Job::What::kCancel) {
      if (completion.status == TransferStatus::kDisconnected) gone_ = true;
      completions_.push_back(std::move(completion));
    }
    changed_.NotifyAll();
  }
  SubmitDeferred();
  Wake(false);
}

TransferStatus OpenDevice::ResetPort(TransferId id) {
  CancelBefore(id);
  {
    sync::MutexLock lock(mutex_);
    const sync::TimeNs end = clock_.Now() + kCancelLimit;
    while ((pending_.size() > deferred_.size() || finishing_ > 0) && clock_.Now() < end) {
      clock_.WaitUntil(mutex_, changed_, end);
    }
  }
  return StatusOf(libusb_reset_device(handle_->get()));
}

void OpenDevice::CancelOne(TransferId id) {
  Pending* pending = nullptr;
  bool deferred = false;
  {
    sync::MutexLock lock(mutex_);
    const auto it = pending_.find(id);
    if (it == pending_.end()) return;
    pending = it->second;
    deferred = std::erase(deferred_, pending) > 0;
    pending->cancelling = !deferred;
  }
  if (deferred) return Complete(*pending, TransferStatus::kCancelled);
  libusb_cancel_transfer(pending->transfer);
  sync::MutexLock lock(mutex_);
  pending->cancelling = false;
  if (std::exchange(pending->done, false)) free_.push_back(pending);
}

void OpenDevice::CancelBefore(TransferId end) {
  std::vector<TransferId> ids;
  {
    sync::MutexLock lock(mutex_);
    for (const auto& [id, pending] : pending_) {
      if (id < end) ids.push_back(id);
    }
  }
  for (const TransferId id : ids) CancelOne(id);
}

// Removes the completed job from the queue in the same critical section that sends the last
// transfer waiting for it, so that transfers submitted later come after these.
void OpenDevice::SubmitDeferred() {
  std::vector<std::pair<Pending*, TransferStatus>> failed;
  {
    sync::MutexLock lock(mutex_);
    if (jobs_.size() <= 1 || ending_) {
      for (Pending* pending : deferred_) {
        // The last requests of a closed device are still sent.
        const bool late = ending_ && pending->asked.type != TransferType::kControl;
        if (!late && SubmitLocked(*pending).ok()) continue;
        failed.emplace_back(pending, ending_ ? TransferStatus::kCancelled
                                     : gone_ ? TransferStatus::kDisconnected
                                             : TransferStatus::kError);
      }
      deferred_.clear();
    }
    if (!jobs_.empty()) jobs_.pop_front();
  }
  for (const auto& [pending, status] : failed) Complete(*pending, status);
}

// ---- shutdown

bool OpenDevice::End(sync::TimeNs patience, sync::TimeNs limit) {
  {
    sync::MutexLock lock(wake_mutex_);
    wake_ = nullptr;
  }
  sync::MutexLock lock(mutex_);
  const sync::TimeNs now = clock_.Now();
  patient_until_ = now + patience;
  ending_ = true;
  changed_.NotifyAll();
  while (!ended_ && clock_.Now() < now + limit) clock_.WaitUntil(mutex_, changed_, now + limit);
  return ended_;
}

bool OpenDevice::Ended() const {
  sync::MutexLock lock(mutex_);
  return ended_;
}

void OpenDevice::GiveBack() {
  SubmitDeferred();
  {
    sync::MutexLock lock(mutex_);
    jobs_.clear();
    const auto requests = [this]() VOXELD_REQUIRES(mutex_) {
      return std::any_of(pending_.begin(), pending_.end(), [](const auto& item) {
        return item.second->asked.type == TransferType::kControl;
      });
    };
    while (requests() && clock_.Now() < patient_until_) {
      clock_.WaitUntil(mutex_, changed_, patient_until_);
    }
  }
  CancelBefore(std::numeric_limits<TransferId>::max());
  {
    sync::MutexLock lock(mutex_);
    while (!pending_.empty() || finishing_ > 0) changed_.Wait(mutex_);
  }
  libusb_release_interface(handle_->get(), interface_);
  sync::MutexLock lock(mutex_);
  ended_ = true;
  changed_.NotifyAll();
}

}  // namespace voxeld::display
