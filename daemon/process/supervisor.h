// The process that started and supervises the daemon, such as systemd. It is notified when the
// daemon is ready, alive or stopping. It may pass listening sockets, so that no client is refused
// while the daemon restarts. Implements the protocols of sd_notify(3) and sd_listen_fds(3) from
// their documentation, in a few lines; the library would add compression and cryptography code to a
// process that is exposed to strangers.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "daemon/address/descriptor.h"
#include "display/sync/clock.h"

namespace voxeld::daemon {

// A listening socket that the process inherited.
struct InheritedSocket {
  Descriptor descriptor;
  std::string name;  // FileDescriptorName=; empty: none
};

// Notifications are thread-safe, do nothing without a supervisor, and are dropped if they cannot be
// sent.
class Supervisor {
 public:
  using Environment = std::function<std::optional<std::string>(const char* name)>;

  // Reads NOTIFY_SOCKET, WATCHDOG_USEC, WATCHDOG_PID, LISTEN_FDS, LISTEN_PID and LISTEN_FDNAMES.
  // The LISTEN variables are ignored if they are meant for another process. Create one per process:
  // it owns the descriptors.
  explicit Supervisor(const Environment& environment);
  // Reads the process's environment and removes these variables, so that no child inherits them.
  static Supervisor OfProcess();

  bool present() const { return !socket_.empty(); }
  // Returns: the longest interval between calls of Alive that the supervisor accepts; 0: it expects
  // none.
  sync::TimeNs watchdog_ns() const { return watchdog_ns_; }
  std::vector<InheritedSocket> TakeSockets() { return std::move(sockets_); }

  void Ready(std::string_view status) const;
  void Alive() const;
  void Reloading() const;  // until the next Ready
  void Stopping() const;
  void Status(std::string_view status) const;  // one line for people

 private:
  void Tell(std::string text) const;

  std::string socket_;  // empty: no supervisor; "@" begins an abstract name
  sync::TimeNs watchdog_ns_ = 0;
  std::vector<InheritedSocket> sockets_;
};

}  // namespace voxeld::daemon
