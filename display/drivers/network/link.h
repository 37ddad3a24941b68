// What carries packets to a controller: a socket of this machine's, or whatever a test puts in its place.
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

// An IPv4 or IPv6 address in numbers, and a port: "192.168.1.20:4048", "[fe80::1]:4048".
struct Endpoint {
  std::string host;
  uint16_t port = 0;
  std::string text() const;
};
// InvalidArgument with what would be right. Without a port: `fallback`. Names are not looked up: that may take seconds, and the
// address behind one changes.
absl::StatusOr<Endpoint> ParseEndpoint(const std::string& text, uint16_t fallback);

// Bound to one thread, but for the wake. No call blocks.
class Link {
 public:
  enum class State : uint8_t { kClosed, kOpening, kOpen };

  virtual ~Link() = default;
  // Begins to open; what comes of it Poll tells.
  virtual absl::Status Open() = 0;
  virtual void Close() = 0;
  // The state now, or why it is closed again: Unavailable.
  virtual absl::StatusOr<State> Poll() = 0;
  // How many of the bytes were taken: a datagram all or none, of a stream what fits. Unavailable: it is gone.
  virtual absl::StatusOr<size_t> Send(std::span<const std::byte> bytes) = 0;
  // Called, from any thread, when Poll or Send may have more to say. Null: no more.
  virtual void SetWake(std::function<void()> wake) = 0;
};

// Of datagrams. Who hears nothing is found out by what comes back when something is sent.
std::unique_ptr<Link> MakeUdpLink(const Endpoint& to);
// Of a stream, with a thread that waits for its socket.
std::unique_ptr<Link> MakeTcpLink(const Endpoint& to);

}  // namespace voxeld::display::network
