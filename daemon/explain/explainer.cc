#include "daemon/explain/explainer.h"

#include <utility>

namespace voxeld::daemon {

ExplainerThread::~ExplainerThread() {
  std::thread thread;
  {
    sync::MutexLock lock(mutex_);
    stopping_ = true;
    changed_.NotifyAll();
    thread = std::move(thread_);
  }
  if (thread.joinable()) thread.join();
}

bool ExplainerThread::Post(Work work) {
  sync::MutexLock lock(mutex_);
  if (waiting_.size() >= most_waiting_) return false;
  waiting_.push_back(std::move(work));
  if (!thread_.joinable()) thread_ = std::thread([this] { Run(); });
  changed_.NotifyAll();
  return true;
}

void ExplainerThread::Run() {
  for (;;) {
    Work work;
    {
      sync::MutexLock lock(mutex_);
      while (!stopping_ && waiting_.empty()) changed_.Wait(mutex_);
      if (stopping_) return;
      work = std::move(waiting_.front());
      waiting_.pop_front();
    }
    work(stopping_);
  }
}

}  // namespace voxeld::daemon
