// How the single thread of a conformance run waits for its device.
#pragma once

#include "display/sync/clock.h"
#include "display/sync/mutex.h"
#include "display/usb/usb_transport.h"

namespace voxeld::display::conformance {

class Waiter {
 public:
  virtual ~Waiter() = default;
  // Waits until the transport may have something to drain, or until `until`. May return early.
  virtual void Wait(sync::TimeNs until) = 0;
};

// Waits for the transport's wake, and must be its only user during its lifetime.
class WakeWaiter final : public Waiter {
 public:
  WakeWaiter(UsbTransport& transport, sync::Clock& clock);
  ~WakeWaiter() override;
  void Wait(sync::TimeNs until) override;
  // Ends the wait in progress, or the next one. Any thread.
  void Wake();

 private:
  UsbTransport& transport_;
  sync::Clock& clock_;
  sync::Mutex mutex_;
  sync::CondVar changed_;
  bool woken_ VOXELD_GUARDED_BY(mutex_) = false;
};

}  // namespace voxeld::display::conformance
