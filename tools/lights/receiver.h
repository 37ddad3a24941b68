// The sockets on which light data is received.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "display/sync/clock.h"
#include "tools/lights/intake.h"

namespace voxeld::lights {

struct ReceiverOptions {
  std::string listen;  // HOST:PORT or [IPv6]:PORT, numeric; port 0 takes any free port
  // E1.31: also receives from the groups of its universes (239.255.U.U, §9.3.1), if the system lets
  // them be joined.
  bool multicast = false;
  size_t most_connections = 64;  // Open Pixel Control; further ones are closed
};

struct ReceiverTally {
  uint64_t connections = 0;  // Open Pixel Control: accepted
  uint64_t refused = 0;      // of them, closed because the maximum number was open
  uint64_t cut_off = 0;      // ended within a message
  uint64_t open = 0;         // now
  uint64_t groups = 0;       // E1.31: groups that were joined
};

// Bound to one thread, except Wake. It holds at most 128 KiB per connection.
class Receiver {
 public:
  // Opens the socket. `intake` and `clock` must outlive it. Errors: InvalidArgument if the address
  // is not valid; Unavailable names the address and why it cannot be used.
  static absl::StatusOr<std::unique_ptr<Receiver>> Open(const ReceiverOptions& options,
                                                        const IntakeOptions& lights, Intake& intake,
                                                        sync::Clock& clock);
  ~Receiver();
  Receiver(const Receiver&) = delete;
  Receiver& operator=(const Receiver&) = delete;

  std::string address() const;  // the bound address
  ReceiverTally tally() const;

  // Processes what has been received; if nothing has, waits for at most `limit_ns`.
  void Run(sync::TimeNs limit_ns);
  // Ends the current Run, or the next one. Thread-safe.
  void Wake();

 private:
  class Impl;
  explicit Receiver(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace voxeld::lights
