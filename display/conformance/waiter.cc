#include "display/conformance/waiter.h"

namespace voxeld::display::conformance {

WakeWaiter::WakeWaiter(UsbTransport& transport, sync::Clock& clock)
    : transport_(transport), clock_(clock) {
  transport_.SetWake([this] { Wake(); });
}

WakeWaiter::~WakeWaiter() { transport_.SetWake(nullptr); }

void WakeWaiter::Wake() {
  sync::MutexLock lock(mutex_);
  woken_ = true;
  changed_.NotifyAll();
}

void WakeWaiter::Wait(sync::TimeNs until) {
  sync::MutexLock lock(mutex_);
  while (!woken_ && clock_.Now() < until) clock_.WaitUntil(mutex_, changed_, until);
  woken_ = false;
}

}  // namespace voxeld::display::conformance
