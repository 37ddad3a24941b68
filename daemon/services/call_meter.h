// Tells the guard what connections' bytes result in: cancelled calls, new calls and messages. Calls
// that are reset before their request is complete reach neither services nor interceptors, yet cost
// as much as others. Only gRPC's statistics of a connection (channelz) include all of them.
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

// Totals of one connection since it was accepted.
struct CallTotals {
  uint64_t started = 0, succeeded = 0, failed = 0, messages = 0;

  // Returns: the number of calls that ended without an answer. Calls beyond `at_once` without a
  // result must have ended, because the connection may have only that many.
  uint64_t Cancelled(uint64_t at_once) const;
  uint64_t Open() const;
  // Parses channelz' JSON of a socket. Missing values are 0.
  static CallTotals FromJson(std::string_view json);
};

// Runs on its own thread. Checks only connections that are busy, and sleeps if there are none.
class CallMeter {
 public:
  static constexpr sync::TimeNs kInterval = 20 * sync::kMillisecond;

  // `guard` and the clock must outlive the meter. `at_once` is the limit on concurrent calls of a
  // connection.
  CallMeter(listen::Guard& guard, uint64_t at_once, sync::Clock& clock);
  ~CallMeter();
  CallMeter(const CallMeter&) = delete;
  CallMeter& operator=(const CallMeter&) = delete;

 private:
  void Run();
  void Look();
  // Adds the sockets that were created since the last call.
  void ListSockets();

  listen::Guard& guard_;
  const uint64_t at_once_;
  sync::Clock& clock_;
  // Channelz' numbers by peer name, and the smallest unknown number. Used by the thread only.
  std::map<std::string, int64_t> sockets_;
  int64_t next_socket_ = 0;
  sync::Mutex mutex_;
  sync::CondVar changed_;
  bool busy_ VOXELD_GUARDED_BY(mutex_) = false;
  bool stop_ VOXELD_GUARDED_BY(mutex_) = false;
  std::thread thread_;
};

}  // namespace voxeld::daemon::services
