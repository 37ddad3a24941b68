// A client of a Foxglove WebSocket server, as viewers are (the protocol foxglove.websocket.v1 or
// foxglove.sdk.v1, implemented from its specification). It subscribes to every channel of
// SceneUpdate.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "tools/markers/foxglove_channels.h"

namespace voxeld::markers {

struct FoxgloveUrl {
  std::string host, port, path;
};
// Parses "ws://HOST:PORT/PATH"; the default port is 8765. Errors: InvalidArgument for everything
// else.
absl::StatusOr<FoxgloveUrl> ParseFoxgloveUrl(std::string_view url);

struct FoxgloveOptions {
  FoxgloveUrl url;
  std::vector<std::string> topics;          // empty: all
  uint64_t most_message_bytes = 64u << 20;  // a longer message ends the connection
};

// Bound to one thread, except Interrupt.
class FoxgloveClient {
 public:
  // Connects within ten seconds. Errors: Unavailable with the reason; FailedPrecondition if the
  // other end speaks another protocol.
  static absl::StatusOr<std::unique_ptr<FoxgloveClient>> Open(const FoxgloveOptions& options);
  ~FoxgloveClient();
  FoxgloveClient(const FoxgloveClient&) = delete;
  FoxgloveClient& operator=(const FoxgloveClient&) = delete;

  // Blocks until there is a message. Subscribes to channels as the server advertises them. Errors:
  // Unavailable when the connection ends and after Interrupt; ResourceExhausted if a message was
  // too large; InvalidArgument if a message violates the protocol, in which case the next call
  // continues.
  absl::StatusOr<FoxgloveMessage> Next();

  // Returns the server's channels that are not of SceneUpdate or use an unsupported encoding: "/tf
  // (foxglove.FrameTransform)".
  const std::vector<std::string>& passed_over() const;
  size_t subscribed() const;

  // Makes Next return. Thread-safe.
  void Interrupt();

 private:
  class Impl;
  explicit FoxgloveClient(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace voxeld::markers
