// Whoever started the process and watches it, as systemd does: it is told when the daemon is ready, alive
// and ending, and may have opened the listening sockets already, so that no client is refused while the
// daemon starts anew. The protocol is sd_notify(3)'s and sd_listen_fds(3)'s, by its documentation: a few
// lines, for which the library would bring compression and cryptography into a process that strangers
// talk to.
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

// A listening socket that was open when the process began.
struct InheritedSocket {
  Descriptor descriptor;
  std::string name;  // FileDescriptorName=; empty: none
};

// Telling is thread-safe, and does nothing where nobody asked for it. What cannot be told is left out.
class Supervisor {
 public:
  using Environment = std::function<std::optional<std::string>(const char* name)>;

  // NOTIFY_SOCKET, WATCHDOG_USEC and WATCHDOG_PID, LISTEN_FDS, LISTEN_PID and LISTEN_FDNAMES; the last
  // three of another process are nobody's. Once a process: the descriptors are then this object's.
  explicit Supervisor(const Environment& environment);
  // From the process's own environment, from which they are taken away, so that no child finds them.
  static Supervisor OfProcess();

  bool present() const { return !socket_.empty(); }
  // How often it wants to be told Alive at the latest; 0: it does not.
  sync::TimeNs watchdog_ns() const { return watchdog_ns_; }
  std::vector<InheritedSocket> TakeSockets() { return std::move(sockets_); }

  void Ready(std::string_view status) const;
  void Alive() const;
  void Reloading() const;  // until Ready is told again
  void Stopping() const;
  void Status(std::string_view status) const;  // a line for people

 private:
  void Tell(std::string text) const;

  std::string socket_;  // empty: nobody is to be told; "@" begins an abstract name
  sync::TimeNs watchdog_ns_ = 0;
  std::vector<InheritedSocket> sockets_;
};

}  // namespace voxeld::daemon
