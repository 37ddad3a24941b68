#include "daemon/play/worker.h"

#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"

namespace voxeld::daemon::play {

Worker::~Worker() {
  std::deque<std::function<void()>> dropped;
  {
    const sync::MutexLock lock(mutex_);
    ends_ = true;
    dropped.swap(waiting_);
  }
  changed_.NotifyAll();
  dropped.clear();
  if (thread_.joinable()) thread_.join();
}

absl::Status Worker::Post(std::function<void()> work) {
  const sync::MutexLock lock(mutex_);
  try {
    if (!thread_.joinable()) thread_ = std::thread([this] { Run(); });
  } catch (const std::system_error& error) {
    return absl::ResourceExhaustedError(
        absl::StrCat("there is no thread to be had for it now: ", error.code().message()));
  }
  waiting_.push_back(std::move(work));
  changed_.NotifyAll();
  return absl::OkStatus();
}

size_t Worker::waiting() const {
  const sync::MutexLock lock(mutex_);
  return waiting_.size();
}

void Worker::Run() {
  for (;;) {
    std::function<void()> work;
    {
      const sync::MutexLock lock(mutex_);
      while (waiting_.empty() && !ends_) changed_.Wait(mutex_);
      if (ends_) return;
      work = std::move(waiting_.front());
      waiting_.pop_front();
    }
    work();
  }
}

}  // namespace voxeld::daemon::play
