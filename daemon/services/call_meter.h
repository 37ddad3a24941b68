// Says what comes of connections' bytes, for the guard: the calls that clients give up, those that
// begin, and their messages. Calls that are reset before
// their request is whole never come to a service, nor to an interceptor, yet each costs as much as any
// other; gRPC's own figures of a connection (channelz) have them all.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <thread>

#include "daemon/listen/guard.h"
#include "display/sync/clock.h"
#include "display/sync/mutex.h"

namespace voxeld::daemon::services {

// Of one connection, since it was accepted.
struct CallTotals {
  uint64_t started = 0, succeeded = 0, failed = 0, messages = 0;

  // Those that ended without an answer, and those that must have: more than `at_once` are not ended,
  // which is what the connection may have.
  uint64_t Cancelled(uint64_t at_once) const;
  uint64_t Open() const;
  // From channelz' JSON of a socket. What is not there is 0.
  static CallTotals FromJson(std::string_view json);
};

// On a thread of its own, as long as it lives; looks only at connections that are busy, and sleeps while
// none is.
class CallMeter {
 public:
  static constexpr sync::TimeNs kInterval = 20 * sync::kMillisecond;

  // `guard` and the clock outlive the meter. `at_once`: calls that a connection may have.
  CallMeter(listen::Guard& guard, uint64_t at_once, sync::Clock& clock);
  ~CallMeter();
  CallMeter(const CallMeter&) = delete;
  CallMeter& operator=(const CallMeter&) = delete;

 private:
  void Run();
  void Look();
  // Those that came since it was last called.
  void ListSockets();

  listen::Guard& guard_;
  const uint64_t at_once_;
  sync::Clock& clock_;
  // Channelz' numbers by the peer's name, and the least that is not among them; the thread's own.
  std::map<std::string, int64_t> sockets_;
  int64_t next_socket_ = 0;
  sync::Mutex mutex_;
  sync::CondVar changed_;
  bool busy_ VOXELD_GUARDED_BY(mutex_) = false;
  bool stop_ VOXELD_GUARDED_BY(mutex_) = false;
  std::thread thread_;
};

}  // namespace voxeld::daemon::services
