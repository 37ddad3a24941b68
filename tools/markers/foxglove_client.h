// A client of a Foxglove WebSocket server, as viewers are (the protocol foxglove.websocket.v1, or foxglove.sdk.v1, by its specification): takes in
// every channel of SceneUpdate.
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
// "ws://HOST:PORT/PATH"; without a port 8765. InvalidArgument for all else.
absl::StatusOr<FoxgloveUrl> ParseFoxgloveUrl(std::string_view url);

struct FoxgloveOptions {
  FoxgloveUrl url;
  std::vector<std::string> topics;          // empty: all
  uint64_t most_message_bytes = 64u << 20;  // a longer one ends the connection
};

// For one thread, but for Interrupt.
class FoxgloveClient {
 public:
  // Connects, within ten seconds. Unavailable says why not; FailedPrecondition if the other end speaks something else.
  static absl::StatusOr<std::unique_ptr<FoxgloveClient>> Open(const FoxgloveOptions& options);
  ~FoxgloveClient();
  FoxgloveClient(const FoxgloveClient&) = delete;
  FoxgloveClient& operator=(const FoxgloveClient&) = delete;

  // Blocks until there is one. Channels are subscribed to as the server tells of them. Unavailable at the connection's end, and
  // after Interrupt; ResourceExhausted when a message was too large; InvalidArgument for what is not of the protocol: the next call goes on.
  absl::StatusOr<FoxgloveMessage> Next();

  // What the server has that is no SceneUpdate here, or in an encoding that is not read: "/tf (foxglove.FrameTransform)".
  const std::vector<std::string>& passed_over() const;
  size_t subscribed() const;

  // Thread-safe: Next ends.
  void Interrupt();

 private:
  class Impl;
  explicit FoxgloveClient(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace voxeld::markers
