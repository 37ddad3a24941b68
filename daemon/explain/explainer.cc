#include "daemon/explain/explainer.h"

#include <utility>

namespace voxeld::daemon {

bool ExplainerThread::Post(Work work) {
  if (waiting_.fetch_add(1) >= most_waiting_) {
    waiting_.fetch_sub(1);
    return false;
  }
  queue_.Post([this, work = std::move(work)](bool cancelled) {
    waiting_.fetch_sub(1);
    if (!cancelled) work(stopping_);
  });
  return true;
}

}  // namespace voxeld::daemon
