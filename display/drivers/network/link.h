// Carries packets to a controller: through a socket of this machine, or a test's substitute.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace voxeld::display::network {

// A numeric IPv4 or IPv6 address, and a port: "192.168.1.20:4048", "[fe80::1]:4048".
struct Endpoint {
  std::string host;
  uint16_t port = 0;
  std::string text() const;
};
// Parses an endpoint; `fallback` is the default port. Errors: InvalidArgument with what is
// expected. Names are not resolved: that may take seconds, and the address of a name can change.
absl::StatusOr<Endpoint> ParseEndpoint(const std::string& text, uint16_t fallback);

// Bound to one thread, except for the wake. No call blocks.
class Link {
 public:
  enum class State : uint8_t { kClosed, kOpening, kOpen };

  virtual ~Link() = default;
  // Starts to open; Poll reports the result.
  virtual absl::Status Open() = 0;
  virtual void Close() = 0;
  // Returns the current state, or why the link closed again: Unavailable.
  virtual absl::StatusOr<State> Poll() = 0;
  // Returns how many bytes were accepted: for datagrams all or none, for a stream what fits.
  // Errors: Unavailable if the link is gone.
  virtual absl::StatusOr<size_t> Send(std::span<const std::byte> bytes) = 0;
  // Sets the function to call, from any thread, when Poll or Send may have something new. Null:
  // none.
  virtual void SetWake(std::function<void()> wake) = 0;
};

// Makes a datagram link. An absent receiver is detected by the errors that sending to it returns.
std::unique_ptr<Link> MakeUdpLink(const Endpoint& to);
// Makes a stream link, with a thread that waits for its socket.
std::unique_ptr<Link> MakeTcpLink(const Endpoint& to);

}  // namespace voxeld::display::network
