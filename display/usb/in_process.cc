#include "display/usb/in_process.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "display/usb/slab_memory.h"

namespace voxeld::display {
namespace {

size_t SizeOf(const Transfer& transfer) {
  return std::max<size_t>(transfer.data.size(), transfer.length);
}

// USB 2.0 §9.4.1: CLEAR_FEATURE(ENDPOINT_HALT).
constexpr uint8_t kToEndpoint = 0x02;
constexpr uint8_t kClearFeature = 0x01;

constexpr size_t kSlabBytes = size_t{256} << 10;
constexpr size_t kSlabs = 16;

// Slabs of ordinary memory, allocated at once and touched as they are used.
class HeapSlabs final : public SlabMemory {
 public:
  static std::shared_ptr<TransferMemory> Make() {
    auto memory = std::make_unique_for_overwrite<std::byte[]>(kSlabs * kSlabBytes);
    std::vector<void*> slabs;
    for (size_t i = 0; i < kSlabs; ++i) slabs.push_back(memory.get() + i * kSlabBytes);
    return std::make_shared<HeapSlabs>(std::move(memory), std::move(slabs));
  }
  HeapSlabs(std::unique_ptr<std::byte[]> memory, std::vector<void*> slabs)
      : SlabMemory(std::move(slabs), kSlabBytes), memory_(std::move(memory)) {}

 private:
  const std::unique_ptr<std::byte[]> memory_;
};

}  // namespace

InProcessTransport::InProcessTransport(std::unique_ptr<UsbDeviceModel> device, sync::Clock& clock,
                                       Options options)
    : clock_(clock),
      options_(std::move(options)),
      device_(std::move(device)),
      memory_(HeapSlabs::Make()) {
  device_->SetComplete([this](uint64_t id, TransferStatus status, uint32_t actual,
                              std::span<const std::byte> in) VOXELD_NO_THREAD_SAFETY_ANALYSIS {
    OnComplete(id, status, actual, in);  // called inside a call of the model: device_mutex_ is held
  });
  if (options_.own_thread) thread_ = std::thread([this] { Run(); });
}

InProcessTransport::~InProcessTransport() {
  Close();
  if (!thread_.joinable()) return;
  {
    sync::MutexLock lock(mutex_);
    stop_ = true;
    work_.NotifyAll();
  }
  thread_.join();
}

absl::Status InProcessTransport::Open() {
  sync::MutexLock device_lock(device_mutex_);
  sync::MutexLock lock(mutex_);
  if (open_) return absl::FailedPreconditionError("the device is open already");
  if (!device_->plugged()) return absl::NotFoundError("the emulated device is unplugged");
  was_plugged_ = true;
  seen_plugs_ = device_->plugs();
  open_ = true;
  gone_ = false;
  arrived_ = false;
  return absl::OkStatus();
}

void InProcessTransport::Close() {
  Pump();  // let the device answer what it can answer at once
  sync::MutexLock device_lock(device_mutex_);
  for (const auto& [id, pending] : pending_) device_->Unlink(id);
  pending_.clear();
  sync::MutexLock lock(mutex_);
  requests_.clear();
  completions_.clear();
  bytes_in_flight_ = 0;
  open_ = false;
}

bool InProcessTransport::is_open() const {
  sync::MutexLock lock(mutex_);
  return open_;
}

absl::StatusOr<TransferId> InProcessTransport::Queue(Transfer&& transfer, bool reset) {
  sync::MutexLock lock(mutex_);
  if (!open_) return absl::FailedPreconditionError("the device is not open");
  if (gone_) return absl::UnavailableError("the device was unplugged");
  const size_t size = SizeOf(transfer);
  if (size > options_.max_bytes_in_flight - bytes_in_flight_) {
    return absl::ResourceExhaustedError(absl::StrCat(size, " bytes more than the ",
                                                     bytes_in_flight_, " in flight; at most ",
                                                     options_.max_bytes_in_flight, " may be"));
  }
  bytes_in_flight_ += size;
  const TransferId id = next_id_++;
  requests_.emplace_back(Request{id, std::move(transfer), reset});
  work_.NotifyAll();
  return id;
}

absl::StatusOr<TransferId> InProcessTransport::Submit(Transfer&& transfer) {
  return Queue(std::move(transfer));
}

absl::StatusOr<TransferId> InProcessTransport::ClearHalt(uint8_t endpoint) {
  Transfer transfer;
  transfer.type = TransferType::kControl;
  transfer.setup = {.request_type = kToEndpoint,
                    .request = kClearFeature,
                    .value = 0,
                    .index = endpoint,
                    .length = 0};
  return Queue(std::move(transfer));
}

absl::StatusOr<TransferId> InProcessTransport::Reset() {
  Transfer transfer;
  transfer.type = TransferType::kControl;
  return Queue(std::move(transfer), true);
}

TransferBytes InProcessTransport::TakeBuffer(size_t capacity) {
  TransferBytes buffer(memory_);
  buffer.reserve(capacity);
  return buffer;
}

bool InProcessTransport::TakeArrival() {
  sync::MutexLock lock(mutex_);
  return std::exchange(arrived_, false);
}

void InProcessTransport::Cancel(TransferId id) {
  sync::MutexLock lock(mutex_);
  requests_.emplace_back(id);
  work_.NotifyAll();
}

size_t InProcessTransport::Drain(std::vector<TransferCompletion>& out) {
  sync::MutexLock lock(mutex_);
  const size_t count = completions_.size();
  std::move(completions_.begin(), completions_.end(), std::back_inserter(out));
  completions_.clear();
  return count;
}

size_t InProcessTransport::bytes_in_flight() const {
  sync::MutexLock lock(mutex_);
  return bytes_in_flight_;
}

void InProcessTransport::SetWake(std::function<void()> wake) {
  sync::MutexLock lock(wake_mutex_);
  wake_ = std::move(wake);
}

void InProcessTransport::CallWake() {
  sync::MutexLock lock(wake_mutex_);
  if (wake_) wake_();
}

void InProcessTransport::Give(Request request) {
  Pending pending{std::move(request.transfer), sync::kNever};
  if (pending.transfer.timeout > 0) pending.deadline = clock_.Now() + pending.transfer.timeout;
  const Transfer& transfer =
      pending_.emplace(request.id, std::move(pending)).first->second.transfer;
  Urb urb;
  urb.id = request.id;
  urb.endpoint = transfer.endpoint;
  urb.setup = transfer.setup;
  urb.out = transfer.data;
  urb.length = transfer.length;
  urb.zero_packet = transfer.zero_packet;
  if (!device_->plugged() || device_->plugs() != seen_plugs_) {
    OnComplete(urb.id, TransferStatus::kDisconnected, 0, {});
  } else if (request.reset) {
    device_->Reset();
    OnComplete(urb.id, TransferStatus::kOk, 0, {});
  } else {
    device_->Submit(urb);
  }
}

void InProcessTransport::OnComplete(uint64_t id, TransferStatus status, uint32_t actual,
                                    std::span<const std::byte> in) {
  const auto it = pending_.find(id);
  if (it == pending_.end()) return;
  Transfer transfer = std::move(it->second.transfer);
  pending_.erase(it);
  const size_t size = SizeOf(transfer);
  TransferCompletion completion;
  completion.id = id;
  completion.type = transfer.type;
  completion.endpoint = transfer.endpoint;
  completion.status = status;
  completion.actual_length = actual;
  completion.data = std::move(transfer.data);
  if (transfer.length > 0) completion.data = TransferBytes(in);
  sync::MutexLock lock(mutex_);
  bytes_in_flight_ -= size;
  completions_.push_back(std::move(completion));
}

void InProcessTransport::ExpireTimeouts(sync::TimeNs now) {
  std::vector<TransferId> late;
  for (const auto& [id, pending] : pending_) {
    if (pending.deadline <= now) late.push_back(id);
  }
  for (const TransferId id : late) {
    if (device_->Unlink(id)) OnComplete(id, TransferStatus::kTimedOut, 0, {});
  }
}

sync::TimeNs InProcessTransport::Pump() {
  bool wake = false;
  sync::TimeNs next = sync::kNever;
  {
    sync::MutexLock device_lock(device_mutex_);
    std::deque<std::variant<Request, TransferId>> requests;
    {
      sync::MutexLock lock(mutex_);
      requests.swap(requests_);
    }
    for (auto& request : requests) {
      if (auto* submit = std::get_if<Request>(&request)) {
        Give(std::move(*submit));
      } else if (device_->Unlink(std::get<TransferId>(request))) {
        OnComplete(std::get<TransferId>(request), TransferStatus::kCancelled, 0, {});
      }
    }
    device_->Tick();
    ExpireTimeouts(clock_.Now());
    const bool plugged = device_->plugged();
    const bool stale = !plugged || device_->plugs() != seen_plugs_;
    next = device_->NextTimeout();
    for (const auto& [id, pending] : pending_) next = std::min(next, pending.deadline);
    const bool changed = plugged != was_plugged_;
    was_plugged_ = plugged;
    sync::MutexLock lock(mutex_);
    if (open_ && stale) gone_ = true;
    if (!open_ && changed && plugged) arrived_ = true;
    wake = !completions_.empty() || changed;
  }
  if (wake) CallWake();
  return next;
}

void InProcessTransport::WithDevice(const std::function<void(UsbDeviceModel&)>& function) {
  {
    sync::MutexLock device_lock(device_mutex_);
    function(*device_);
  }
  sync::MutexLock lock(mutex_);
  poked_ = true;
  work_.NotifyAll();
}

void InProcessTransport::Run() {
  while (true) {
    const sync::TimeNs next = Pump();
    sync::MutexLock lock(mutex_);
    while (!stop_ && !poked_ && requests_.empty() && clock_.Now() < next) {
      clock_.WaitUntil(mutex_, work_, next);
    }
    if (stop_) return;
    poked_ = false;
  }
}

}  // namespace voxeld::display
