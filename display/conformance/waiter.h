// How the one thread of a conformance run waits for its device.
#pragma once

#include "display/sync/clock.h"
#include "display/sync/mutex.h"
#include "display/usb/usb_transport.h"

namespace voxeld::display::conformance {

class Waiter {
 public:
  virtual ~Waiter() = default;
  // Until the transport may have something to drain, or `until` has come. May return early.
  virtual void Wait(sync::TimeNs until) = 0;
};

// Waits for the transport's wake, of which it is the only taker as long as it lives.
class WakeWaiter final : public Waiter {
 public:
  WakeWaiter(UsbTransport& transport, sync::Clock& clock);
  ~WakeWaiter() override;
  void Wait(sync::TimeNs until) override;
  // Any thread: the wait in progress, or the next one, ends.
  void Wake();

 private:
  UsbTransport& transport_;
  sync::Clock& clock_;
  sync::Mutex mutex_;
  sync::CondVar changed_;
  bool woken_ VOXELD_GUARDED_BY(mutex_) = false;
};

}  // namespace voxeld::display::conformance
