// The sockets at which light comes in.
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
  std::string listen;  // HOST:PORT or [IPv6]:PORT, by number; port 0 takes any that is free
  // E1.31: also what goes to the groups of its universes (239.255.U.U, §9.3.1), where the system lets them be joined.
  bool multicast = false;
  size_t most_connections = 64;  // Open Pixel Control; further ones are closed
};

struct ReceiverTally {
  uint64_t connections = 0;  // Open Pixel Control: that came
  uint64_t refused = 0;      // of them: as many as may be were open
  uint64_t cut_off = 0;      // ended within a message
  uint64_t open = 0;         // now
  uint64_t groups = 0;       // E1.31: that were joined
};

// Bound to one thread, but for Wake. It holds 128 KiB a connection at most.
class Receiver {
 public:
  // `intake` and `clock` outlive it. InvalidArgument: no such address. Unavailable says which address, and why it cannot be had.
  static absl::StatusOr<std::unique_ptr<Receiver>> Open(const ReceiverOptions& options,
                                                        const IntakeOptions& lights, Intake& intake,
                                                        sync::Clock& clock);
  ~Receiver();
  Receiver(const Receiver&) = delete;
  Receiver& operator=(const Receiver&) = delete;

  std::string address() const;  // that it has
  ReceiverTally tally() const;

  // Takes in what has come; if nothing has, waits for something for at most so long.
  void Run(sync::TimeNs limit_ns);
  // Ends a Run under way, or the next. Thread-safe.
  void Wake();

 private:
  class Impl;
  explicit Receiver(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace voxeld::lights
