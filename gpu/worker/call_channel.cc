#include "gpu/worker/call_channel.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"

namespace voxeld::gpu {

CallChannel::CallChannel(std::shared_ptr<WorkerProcess> process, int socket, int wake,
                         int64_t deadline_ns, int64_t first_deadline_ns,
                         std::function<void(const absl::Status&)> lost)
    : deadline_ns_(deadline_ns),
      wake_(wake),
      process_(std::move(process)),
      socket_(socket),
      lost_(std::move(lost)),
      allowed_ns_(first_deadline_ns) {
  thread_ = std::thread([this] { Run(); });
}

CallChannel::~CallChannel() {
  Close();
  close(socket_);
  close(wake_);
}

void CallChannel::Close() {
  if (!thread_.joinable()) return;
  {
    sync::MutexLock lock(mutex_);
    closing_ = true;
  }
  Wake();
  thread_.join();
}

void CallChannel::Fail(const absl::Status& status) {
  {
    sync::MutexLock lock(mutex_);
    failed_ = status;
  }
  Wake();
}

void CallChannel::Wake() const {
  const uint64_t one = 1;
  [[maybe_unused]] const ssize_t written = write(wake_, &one, sizeof(one));
}

void CallChannel::Call(Message message, std::function<void(Message&)> ready, Answered answered,
                       int64_t more_ns) {
  absl::Status ended;
  {
    sync::MutexLock lock(mutex_);
    if (ended_.ok()) {
      message.call = next_call_++;
      if (owed_.empty()) give_up_at_ = clock_.Now() + allowed_ns_ + more_ns;
      owed_[message.call] = {std::move(answered), more_ns};
      outgoing_.push_back({std::move(message), std::move(ready), nullptr, nullptr});
      return Wake();
    }
    ended = ended_;
  }
  answered(ended);
}

void CallChannel::Later(std::function<void()> work) {
  {
    sync::MutexLock lock(mutex_);
    if (ended_.ok()) {
      Outgoing later;
      later.work = std::exchange(work, nullptr);
      outgoing_.push_back(std::move(later));
    }
  }
  if (work) return work();
  Wake();
}

void CallChannel::Tell(Message message, std::shared_ptr<Segment> segment) {
  {
    sync::MutexLock lock(mutex_);
    if (!ended_.ok()) return;
    outgoing_.push_back({std::move(message), nullptr, std::move(segment), nullptr});
  }
  Wake();
}

bool CallChannel::HasOutgoing() {
  sync::MutexLock lock(mutex_);
  return !outgoing_.empty();
}

absl::Status CallChannel::SendSome() {
  while (HasOutgoing()) {
    Outgoing next;
    {
      sync::MutexLock lock(mutex_);
      next = std::move(outgoing_.front());
      outgoing_.pop_front();
    }
    if (next.work) {
      next.work();
      continue;
    }
    if (next.ready) std::exchange(next.ready, nullptr)(next.message);
    const absl::Status sent = SendMessage(socket_, next.message);
    if (absl::IsResourceExhausted(sent)) {
      sync::MutexLock lock(mutex_);
      outgoing_.push_front(std::move(next));
      return absl::OkStatus();
    }
    if (!sent.ok()) return sent;
  }
  return absl::OkStatus();
}

absl::Status CallChannel::ReceiveOne() {
  absl::StatusOr<Message> message = ReceiveMessage(socket_);
  if (!message.ok()) return message.status();
  if (message->fd >= 0) close(message->fd);
  Answered answered;
  {
    sync::MutexLock lock(mutex_);
    const auto it = owed_.find(message->call);
    if (it == owed_.end()) {
      return absl::DataLossError(
          absl::StrCat("the worker answered call ", message->call, ", of which no answer is owed"));
    }
    answered = std::move(it->second.answered);
    owed_.erase(it);
    allowed_ns_ = deadline_ns_;
    give_up_at_ =
        owed_.empty() ? sync::kNever : clock_.Now() + allowed_ns_ + owed_.begin()->second.more_ns;
  }
  answered(*std::move(message));
  return absl::OkStatus();
}

void CallChannel::End(const absl::Status& status) {
  std::map<uint64_t, Owed> owed;
  std::deque<Outgoing> left;
  {
    sync::MutexLock lock(mutex_);
    ended_ = status;
    owed.swap(owed_);
    left.swap(outgoing_);
  }
  if (absl::IsDataLoss(status)) process_->Kill();
  process_ = nullptr;
  shutdown(socket_, SHUT_RDWR);
  for (auto& [call, one] : owed) one.answered(status);
  for (Outgoing& outgoing : left) {
    if (outgoing.work) outgoing.work();
  }
  if (lost_ && absl::IsDataLoss(status)) lost_(status);
}

void CallChannel::Run() {
  for (;;) {
    sync::TimeNs give_up_at = sync::kNever;
    absl::Status failed;
    {
      sync::MutexLock lock(mutex_);
      give_up_at = give_up_at_;
      failed = closing_ ? absl::CancelledError("engine: it is being destroyed") : failed_;
    }
    if (!failed.ok()) return End(failed);
    const sync::TimeNs now = clock_.Now();
    pollfd waiting[2] = {{socket_, static_cast<short>(POLLIN | (HasOutgoing() ? POLLOUT : 0)), 0},
                         {wake_, POLLIN, 0}};
    const int64_t wait_ms = give_up_at == sync::kNever
                                ? -1
                                : std::max<int64_t>(0, (give_up_at - now) / sync::kMillisecond + 1);
    poll(waiting, 2, static_cast<int>(std::min<int64_t>(wait_ms, 1 << 30)));
    if ((waiting[1].revents & POLLIN) != 0) {
      uint64_t count = 0;
      [[maybe_unused]] const ssize_t got = read(wake_, &count, sizeof(count));
    }
    absl::Status status;
    const bool answers = (waiting[0].revents & (POLLIN | POLLHUP | POLLERR)) != 0;
    if (!answers && now >= give_up_at) {
      absl::Status late = absl::DataLossError("the worker did not answer in time and was ended");
      late.SetPayload(kLatePayload, absl::Cord());
      return End(late);
    }
    if (answers) status = ReceiveOne();
    if (status.ok()) status = SendSome();
    // The worker's last messages come before the end of the connection.
    while (absl::IsUnavailable(status) && ReceiveOne().ok()) {
    }
    if (!status.ok()) {
      return End(absl::DataLossError(absl::StrCat("the worker was lost: ", status.message())));
    }
  }
}

}  // namespace voxeld::gpu
