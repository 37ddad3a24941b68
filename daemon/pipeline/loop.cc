#include "daemon/pipeline/loop.h"

#include <utility>

namespace voxeld::daemon {

bool Loop::Post(std::function<void()> work) {
  sync::MutexLock lock(mutex_);
  if (closed_) return false;
  posted_.push_back(std::move(work));
  changed_.NotifyAll();
  return true;
}

void Loop::Wake() {
  sync::MutexLock lock(mutex_);
  woken_ = true;
  changed_.NotifyAll();
}

void Loop::Close() {
  sync::MutexLock lock(mutex_);
  closed_ = true;
  changed_.NotifyAll();
}

bool Loop::closed() const {
  sync::MutexLock lock(mutex_);
  return closed_;
}

bool Loop::RunPosted() {
  std::vector<std::function<void()>> work;
  {
    sync::MutexLock lock(mutex_);
    work.swap(posted_);
    woken_ = false;
  }
  for (std::function<void()>& item : work) {
    item();
    item = nullptr;  // what it holds goes now, in order
  }
  return !work.empty();
}

bool Loop::Ready() const {
  sync::MutexLock lock(mutex_);
  return ready();
}

void Loop::Wait(sync::TimeNs deadline) {
  sync::MutexLock lock(mutex_);
  while (!ready() && clock_.Now() < deadline) {
    clock_.WaitUntil(mutex_, changed_, deadline);
  }
}

}  // namespace voxeld::daemon
