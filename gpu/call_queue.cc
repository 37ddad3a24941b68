#include "gpu/call_queue.h"

#include <utility>

namespace voxeld::gpu {

CallQueue::CallQueue(bool run_inline) : inline_(run_inline) {
  if (!inline_) thread_ = std::thread([this] { Run(); });
}

CallQueue::~CallQueue() {
  if (inline_) return;
  {
    sync::MutexLock lock(mutex_);
    stopping_ = true;
  }
  posted_.NotifyOne();
  thread_.join();
}

void CallQueue::Post(Call call) {
  if (inline_) {
    sync::MutexLock lock(inline_mutex_);
    call(/*cancelled=*/false);
    return;
  }
  {
    sync::MutexLock lock(mutex_);
    calls_.push_back(std::move(call));
  }
  posted_.NotifyOne();
}

void CallQueue::Run() {
  for (;;) {
    Call call;
    bool cancelled;
    {
      sync::MutexLock lock(mutex_);
      while (calls_.empty() && !stopping_) posted_.Wait(mutex_);
      if (calls_.empty()) return;
      call = std::move(calls_.front());
      calls_.pop_front();
      cancelled = stopping_;
    }
    call(cancelled);
  }
}

}  // namespace voxeld::gpu
